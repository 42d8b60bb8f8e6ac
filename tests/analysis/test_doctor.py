"""The doctor's advice is the one that every other refusal gives."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from magbend.analysis import doctor
from magbend.core.errors import MissingExtraError

ROOT = Path(__file__).parents[2]


def test_every_optional_part_for_users_is_looked_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    assert set(doctor.EXTRAS) == set(extras) - {"all", "docs", "test"}
    for extra, names in doctor.EXTRAS.items():
        needs = {re.match(r"[\w-]+", need)[0] for need in extras[extra]}
        assert set(names) <= needs


def test_missing_packages_are_installed_from_the_checkout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(doctor, "EXTRAS", {"bayes": ("no-such-package",)})
    monkeypatch.setattr(doctor, "REQUIRED", ("no-such-package",))
    (extra,) = doctor._extras()
    assert extra.status == "absent"
    advice = 'install it in the checkout with: pip install ".[bayes]"'
    assert extra.detail.endswith(advice)
    assert str(MissingExtraError("emcee", "bayes", "sampling")).endswith(advice)
    packages = doctor._required()
    assert packages.status == "broken"
    assert packages.detail.endswith("pip install .")
