"""What the firmware of the twin board remembers, and what all its parts ask of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator

from .dialect import GRBL, Dialect
from .gcode import Modal
from .line import BoardLine
from .mover import Mover
from .plant import Plant
from .settings import OFFSET_ROWS, Eeprom

Task = Generator[float, None, None]
"""A part of the firmware: it yields the time until which it waits."""

RX_BYTES = 128
_TX_BYTES = 104


class Counters:
    """Reports left until the work offset and the overrides are shown again."""

    def __init__(self) -> None:
        self.offset = 0
        self.overrides = 0


class BoardState(BoardLine):
    """Settings, modes, flags and motion of a board, without the loop that drives them.

    Parameters
    ----------
    plant : Plant, optional
        The mechanics; by default those of the recording.
    settings : mapping of int to float, optional
        Settings that differ from the defaults of the generic build.
    dialect : Dialect, optional
        Which firmware it plays.
    """

    def __init__(
        self,
        plant: Plant | None = None,
        settings: dict[int, float] | None = None,
        dialect: Dialect = GRBL,
    ) -> None:
        super().__init__()
        self.dialect = dialect
        self.plant = plant or Plant()
        self.eeprom = Eeprom(settings)
        self.mover = Mover(self._on_step)
        self.counters = Counters()
        self.modal = Modal()
        self.state = "Idle"
        self.position = [0, 0, 0]
        self.planned = [0, 0, 0]
        self.g92 = [0.0, 0.0, 0.0]
        self.overrides = [100, 100, 100]
        self.direction = [0.0, 0.0, 0.0]
        self.alarm = self.switches_seen = 0
        self.flags: set[str] = set()
        self.homing = self.aborted = self.suspended = self.stopping = False
        self.held = self.cancelling = self.soft_limit = False
        self._rx: deque[int] = deque()
        self._wake_s = self._blocked_s = 0.0

    def reset_from_anywhere(self) -> None:
        """Set the reset flag, as the interrupt does; a moving stage stops, alarmed."""
        if "reset" in self.flags:
            return
        self._flag("reset")
        if self.state in ("Run", "Home", "Jog") or self.stopping or self.homing:
            if not self.alarm:
                self.alarm = 6 if self.state == "Home" else 3
            self.mover.kill()

    def _flag(self, name: str) -> None:
        """Set a flag and wake the main loop, wherever it waits."""
        self.flags.add(name)
        self._wake_s = min(self._wake_s, self.now_s)

    def _on_step(self, axis: int, count: int) -> None:
        self.position[axis] += count
        inverted = int(self.eeprom[3]) >> axis & 1
        self.plant.step(axis, -count if inverted else count)

    def print_line(self, text: str) -> Task:
        """Print a line; a full transmit buffer holds the firmware up."""
        self.send(text.encode("ascii") + b"\r\n")
        while (free_s := self.sending_s(_TX_BYTES)) > self.now_s:
            yield free_s

    def pause(self, duration_s: float) -> Task:
        """Wait without looking at any flag."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            yield end_s

    @property
    def rx_free(self) -> int:
        """Free bytes of the receive buffer."""
        return RX_BYTES - len(self._rx)

    def planned_mm(self) -> list[float]:
        """Return where the queued motions end, in machine mm."""
        return [
            s / k if (k := self.eeprom[100 + axis]) else 0.0
            for axis, s in enumerate(self.planned)
        ]

    def offset_mm(self) -> list[float]:
        """Return the work offset WCO, in mm."""
        system = self.eeprom.offsets[f"G{self.modal.system}"]
        return [a + b for a, b in zip(system, self.g92, strict=True)]

    def offsets_report(self) -> list[str]:
        """Return the rows of ``$#``."""
        rows = [f"[{row}:{_three(self.eeprom.offsets[row])}]" for row in OFFSET_ROWS]
        tail = ["[TLO:0.000]", "[PRB:0.000,0.000,0.000:0]"]
        return [*rows, f"[G92:{_three(self.g92)}]", *tail]


def _three(values: list[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
