"""The serial line and the power of a virtual board: bytes take time, and get lost."""

from __future__ import annotations

import heapq
import itertools
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

_BYTE_S = 10.0 / 115200.0


class BoardLine(ABC):
    """Both directions of a line at 115200 baud, and what is due at which time.

    Attributes
    ----------
    now_s : float
        The board's time.
    plugged, port_taken, restart_on_open : bool
        The cable is in; a program has the port open; opening restarts the board.
    latency_s : float
        Delay of everything the board says.
    """

    def __init__(self) -> None:
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._out: deque[tuple[float, bytes]] = deque()
        self._rx_free_s = self._tx_free_s = 0.0
        self._deaf_until_s = self._mute_until_s = 0.0
        self.now_s = 0.0
        self.latency_s = 0.0
        self.plugged = True
        self.port_taken = False
        self.restart_on_open = False

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the pace of the line."""
        for byte in data:
            self._rx_free_s = max(self.now_s, self._rx_free_s) + _BYTE_S
            self.at(self._rx_free_s, lambda byte=byte: self._hear(byte))  # type: ignore[misc]

    @abstractmethod
    def _on_byte(self, byte: int) -> None:
        """Take a byte from the host, when its last bit is here."""

    def _hear(self, byte: int) -> None:
        if self.now_s >= self._deaf_until_s:
            self._on_byte(byte)

    def read(self) -> bytes:
        """Return what has arrived at the host by now."""
        parts = []
        while self._out and self._out[0][0] <= self.now_s:
            parts.append(self._out.popleft()[1])
        return b"".join(parts)

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the host; garbage too, if a test wants it."""
        if self.now_s < self._mute_until_s:
            return
        start_s = max(self.now_s, self._tx_free_s)
        for piece in data.splitlines(keepends=True):
            start_s += len(piece) * _BYTE_S
            self._out.append((start_s + self.latency_s, piece))
        self._tx_free_s = start_s

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Do something at a time of the board."""
        heapq.heappush(self._events, (time_s, next(self._order), action))

    def lose_input(self, duration_s: float) -> None:
        """Lose what the host sends for a while."""
        self._deaf_until_s = self.now_s + duration_s

    def lose_output(self, duration_s: float) -> None:
        """Lose what the board says for a while."""
        self._mute_until_s = self.now_s + duration_s

    def next_event_s(self) -> float:
        """Return when something is due next."""
        return self._events[0][0] if self._events else math.inf

    def run_due(self) -> None:
        """Do what is due by now."""
        while self._events and self._events[0][0] <= self.now_s:
            heapq.heappop(self._events)[2]()

    def sending_s(self, buffered: int) -> float:
        """Return when no more than so many bytes will wait to be sent."""
        return self._tx_free_s - buffered * _BYTE_S
