"""Ctrl-C: the first asks, a second strikes where it may, and nothing else raises."""

from __future__ import annotations

import signal
import threading

import pytest

from magbend.rig import interrupts as module
from magbend.rig.interrupts import StopAtOnce, heed_interrupts


class Presses:
    """Signals to this very process, at times of the test's choosing."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        self.asked = 0
        monkeypatch.setattr(module.time, "monotonic", lambda: self.now_s)

    def ask(self) -> None:
        self.asked += 1

    def press(self, *, after_s: float, number: int = signal.SIGINT) -> None:
        self.now_s += after_s
        signal.raise_signal(number)


@pytest.fixture
def presses(monkeypatch: pytest.MonkeyPatch) -> Presses:
    return Presses(monkeypatch)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_only_asks(presses: Presses, number: int) -> None:
    with heed_interrupts(presses.ask) as received, received.striking():
        presses.press(after_s=1.0, number=number)
        assert presses.asked == 1
    assert received.name == ("Ctrl-C" if number == signal.SIGINT else "SIGTERM")


def test_a_second_one_strikes_once_and_only_where_it_may(presses: Presses) -> None:
    with heed_interrupts(presses.ask) as received:
        presses.press(after_s=1.0)
        presses.press(after_s=1.0)
        struck = 0
        try:
            with received.striking():
                presses.press(after_s=1.0)
        except StopAtOnce:
            struck += 1
            presses.press(after_s=1.0)
    assert (presses.asked, struck) == (1, 1)


def test_one_press_that_is_delivered_twice_is_one(presses: Presses) -> None:
    with heed_interrupts(presses.ask) as received, received.striking():
        presses.press(after_s=1.0)
        presses.press(after_s=0.01, number=signal.SIGTERM)
        presses.press(after_s=0.2)
    assert presses.asked == 1


def test_the_handlers_are_as_they_were_afterwards(presses: Presses) -> None:
    numbers = [signal.SIGINT, signal.SIGTERM]
    before = [signal.getsignal(number) for number in numbers]
    with heed_interrupts(presses.ask):
        assert [signal.getsignal(number) for number in numbers] != before
    assert [signal.getsignal(number) for number in numbers] == before


def test_an_ignored_signal_stays_ignored(presses: Presses) -> None:
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with heed_interrupts(presses.ask):
            presses.press(after_s=1.0, number=signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert presses.asked == 0


def test_another_thread_leaves_the_signals_alone(presses: Presses) -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def work() -> None:
        with heed_interrupts(presses.ask):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]
