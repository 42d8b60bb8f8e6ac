"""One page holds the controls; another takes over only when it says so."""

from __future__ import annotations

import pytest

from magbend.panel.controls import GRACE_S, Controls, NotYoursError


class Hours:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def hours() -> Hours:
    return Hours()


@pytest.fixture
def controls(hours: Hours) -> Controls:
    return Controls(lambda: "noon", hours)


def test_the_first_command_takes_free_controls(controls: Controls) -> None:
    controls.require("a", "Firefox")
    assert controls.holder is not None
    assert controls.holder.name == "Firefox"
    controls.require("a", "Firefox")


def test_another_page_is_refused_until_it_takes_over(controls: Controls) -> None:
    controls.require("a", "Firefox")
    with pytest.raises(NotYoursError, match="Firefox has held the controls since noon"):
        controls.require("b", "Chrome")
    before = controls.take("b", "Chrome", over=True)
    assert before is not None
    assert before.client == "a"
    with pytest.raises(NotYoursError, match="Chrome"):
        controls.require("a", "Firefox")


def test_a_reload_keeps_them_and_staying_away_frees_them(
    controls: Controls, hours: Hours
) -> None:
    controls.require("a", "Firefox")
    controls.away("a")
    hours.now_s = GRACE_S - 1.0
    controls.back("a")
    hours.now_s = 10.0 * GRACE_S
    assert controls.holder is not None
    controls.away("a")
    hours.now_s += GRACE_S + 1.0
    assert controls.holder is None
    controls.require("b", "Chrome")


def test_only_the_holder_can_release(controls: Controls) -> None:
    controls.require("a", "Firefox")
    controls.release("b")
    assert controls.holder is not None
    controls.release("a")
    assert controls.holder is None
