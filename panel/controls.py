"""Who holds the controls: one page at a time, all others watch."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from ..core.errors import MagbendError

GRACE_S = 20.0
"""How long a page without a connection keeps the controls: a reload is short."""


class NotYoursError(MagbendError):
    """Another page holds the controls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """The page that may command: its secret, and how others see it."""

    client: str
    name: str
    since_utc: str


class Controls:
    """The one place that says who may move the bench; safe from any thread.

    Parameters
    ----------
    now_utc : callable
        Time of day, as text.
    now_s : callable
        Monotonic time in s.
    """

    def __init__(
        self, now_utc: Callable[[], str], now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._now_utc = now_utc
        self._now_s = now_s
        self._lock = threading.Lock()
        self._holder: Holder | None = None
        self._gone_s: float | None = None

    @property
    def holder(self) -> Holder | None:
        """Who holds the controls now; a page that stayed away has lost them."""
        with self._lock:
            gone_s = self._gone_s
            if gone_s is not None and self._now_s() - gone_s > GRACE_S:
                self._holder, self._gone_s = None, None
            return self._holder

    def take(self, client: str, name: str, *, over: bool = False) -> Holder | None:
        """Give the controls to a page; return from whom they were taken, if any.

        Raises
        ------
        NotYoursError
            If another page holds them and `over` does not say that this is meant.
        """
        before = self.holder
        if before is not None and before.client != client and not over:
            raise NotYoursError(
                f"{before.name} has held the controls since {before.since_utc}; take "
                f"them over if that person agrees"
            )
        with self._lock:
            self._gone_s = None
            if before is None or before.client != client:
                self._holder = Holder(
                    client=client, name=name, since_utc=self._now_utc()
                )
        return before if before is not None and before.client != client else None

    def require(self, client: str, name: str) -> None:
        """Refuse a command of a page that only watches; free controls are taken.

        Raises
        ------
        NotYoursError
            If another page holds the controls.
        """
        self.take(client, name)

    def release(self, client: str) -> None:
        """Let the controls go, if this page holds them."""
        with self._lock:
            if self._holder is not None and self._holder.client == client:
                self._holder, self._gone_s = None, None

    def away(self, client: str) -> None:
        """Note that the connection of a page is gone."""
        with self._lock:
            if self._holder is not None and self._holder.client == client:
                self._gone_s = self._now_s()

    def back(self, client: str) -> None:
        """Note that a page is connected again."""
        with self._lock:
            if self._holder is not None and self._holder.client == client:
                self._gone_s = None
