"""The doctor's advice is the one that every other refusal gives."""

from __future__ import annotations

import pytest

from magbend.analysis import doctor
from magbend.core.errors import MissingExtraError


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
