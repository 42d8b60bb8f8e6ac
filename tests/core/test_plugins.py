"""What others offer is found, and what is broken in it is one sentence of theirs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from magbend.core.errors import ConfigError
from magbend.core.plugins import load_plugin, offered

GROUP = "magbend.descriptors"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Make an installed package of one module and one entry point."""
    monkeypatch.syspath_prepend(tmp_path)

    def make(package: str, name: str, code: str) -> None:
        monkeypatch.delitem(sys.modules, package, raising=False)
        (tmp_path / f"{package}.py").write_text(code)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Name: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {package}:offer\n")

    return make


def test_an_offer_is_found_and_loaded(install) -> None:
    install("lab_a", "hook_mm", "def offer(x): return 2 * x\n")
    assert "hook_mm" in offered(GROUP)
    assert load_plugin(GROUP, "hook_mm")(4) == 8


@pytest.mark.parametrize(
    ("code", "cause"),
    [
        ("import no_such_module_of_mine\n", "no_such_module_of_mine"),
        ("offer_ = 1\n", "offer"),
        ("1 / 0\n", "ZeroDivisionError"),
    ],
)
def test_a_broken_package_is_named_when_it_is_asked_for(install, code, cause) -> None:
    install("lab_b", "broken", code)
    install("lab_c", "whole", "offer = 3\n")
    assert load_plugin(GROUP, "whole") == 3
    with pytest.raises(ConfigError, match="package lab_b cannot be loaded") as caught:
        load_plugin(GROUP, "broken")
    assert cause in str(caught.value)


def test_a_name_offered_twice_names_both(install) -> None:
    install("lab_d", "twice", "offer = 1\n")
    install("lab_e", "twice", "offer = 2\n")
    with pytest.raises(ConfigError, match="lab_d and lab_e"):
        load_plugin(GROUP, "twice")


def test_an_unknown_name_lists_ours_and_theirs(install) -> None:
    install("lab_f", "theirs", "offer = 1\n")
    with pytest.raises(ConfigError, match=r"one of ours, theirs; instead .nobodys."):
        load_plugin(GROUP, "nobodys", own=("ours",))
