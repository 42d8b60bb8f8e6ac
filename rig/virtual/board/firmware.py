"""A GRBL 1.1h board in software: what it answers, when, and what it does wrong.

The firmware's own structure is kept: an endless main loop that handles one line at a
time, real-time bytes that only set flags, and flags that are looked at in certain
places only. The loop is a generator; time passes where it yields. That is why the
board is deaf where the real one is, swallows the resets that the real one swallows,
and sends the late ``ok`` that the real one sends. It is checked against the recorded
dialogue of a real board (``tests/rig/test_board_dialogue.py``).

Source of the behaviour: gnea/grbl 1.1h (``protocol.c``, ``system.c``, ``limits.c``,
``motion_control.c``). Not modelled: safety door, probing, arcs, spindle, laser.
"""

from __future__ import annotations

import math

from .commands import system_line
from .dialect import GRBL, Dialect
from .gcode import GcodeError, Modal, read_line
from .orders import auto_start, run_order, startup_lines
from .plant import Plant
from .realtime import realtime
from .state import RX_BYTES, BoardState, Counters, Task

_LINE_CHARS = 79
_TICK_S = 0.005
_PASS_S = 2e-5
_OVERRIDES = {
    0x90: (0, 100), 0x91: (0, 10), 0x92: (0, -10), 0x93: (0, 1), 0x94: (0, -1),
}  # fmt: skip


class GrblBoard(BoardState):
    """The board, its settings memory and its stage.

    Parameters
    ----------
    plant : Plant, optional
        The mechanics; by default those of the recording.
    settings : mapping of int to float, optional
        Settings that differ from the defaults of the generic build.
    dialect : Dialect, optional
        Which firmware it plays.

    Attributes
    ----------
    heeds_stops : bool
        Whether a jog cancel and a feed hold stop it: a fault takes that away.
    """

    def __init__(
        self,
        plant: Plant | None = None,
        settings: dict[int, float] | None = None,
        dialect: Dialect = GRBL,
    ) -> None:
        super().__init__(plant, settings, dialect)
        self.heeds_stops = True
        self._power_up()

    # --- what the outside sees ------------------------------------------------

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self.now_s + duration_s
        while True:
            next_s = min(end_s, self._next_s())
            self._go_to(next_s)
            if next_s >= end_s:
                return

    def power_cycle(self, *, boot_s: float = 0.0) -> None:
        """Cut the power and give it back: settings stay, the position does not.

        Parameters
        ----------
        boot_s : float
            Time of the boot loader, in which the board hears nothing.
        """
        self.mover.kill()
        self._power_up()
        self._blocked_s = self.now_s + boot_s
        self.lose_input(boot_s)

    def assume_position(self, *, locked: bool) -> None:
        """Go on from `position` as if the power had never been cut."""
        self.planned = list(self.position)
        self.state = "Alarm" if locked else "Idle"
        self.read()

    # --- time -----------------------------------------------------------------

    def _next_s(self) -> float:
        times = [self.next_event_s()]
        if self.mover.running:
            times.append(self.now_s + _TICK_S)
        times.append(max(self._wake_s, self._blocked_s, self.now_s))
        return min(times)

    def _go_to(self, time_s: float) -> None:
        self.now_s = max(time_s, self.now_s)
        if self.mover.advance(self.now_s):
            # The drivers' idle delay ($1) runs inside the step interrupt: it blocks.
            delay_s = self.eeprom[1] / 1000.0 if self.eeprom[1] < 255 else 0.0
            self._blocked_s = self.now_s + delay_s
            self._flag("cycle stop")
        self._watch_switches()
        self.run_due()
        if self.now_s >= max(self._wake_s, self._blocked_s):
            self._wake_s = max(next(self._task), self.now_s + _PASS_S)

    def _watch_switches(self) -> None:
        switches = self.plant.switches()
        closed = switches & ~self.switches_seen
        self.switches_seen = switches
        if closed and self.eeprom.flag(21) and not self.homing:
            if self.state == "Alarm" or self.alarm:
                return
            self.reset_from_anywhere()
            self.alarm = 1

    # --- reset, flags, real-time bytes ----------------------------------------

    def _power_up(self) -> None:
        self.state = "Alarm" if self.eeprom.flag(22) else "Idle"
        self.position = [0, 0, 0]
        self.overrides = [100, 100, 100]
        self.switches_seen = self.plant.switches()
        self._task = self._firmware()
        self._wake_s = self._blocked_s = self.now_s
        self.alarm = 0
        self.homing = False
        self.flags.clear()
        self._rx.clear()

    def _on_byte(self, byte: int) -> None:
        if byte == 0x18:
            self.reset_from_anywhere()
        elif byte == 0x85:
            if self.state == "Jog" and self.heeds_stops:
                self._flag("cancel")
        elif byte == 0x21 and not self._heeds_hold():
            return
        elif byte in b"?!~":
            self._flag({63: "status", 33: "hold", 126: "start"}[byte])
        elif byte in _OVERRIDES:
            index, change = _OVERRIDES[byte]
            now = 100 if change == 100 else self.overrides[index] + change
            self.overrides[index] = min(max(now, 10), 200)
            self.counters.overrides = 0
        elif byte < 0x80 and len(self._rx) < RX_BYTES:
            self._rx.append(byte)
            self._wake_s = min(self._wake_s, self.now_s)

    def _heeds_hold(self) -> bool:
        return self.heeds_stops and (self.dialect.holds_jogs or self.state != "Jog")

    # --- main loop ------------------------------------------------------------

    def _firmware(self) -> Task:
        while True:
            self.overrides = [100, 100, 100]
            self.counters = Counters()
            self.flags.clear()
            self.alarm = 0
            self._rx.clear()
            self.aborted = self.suspended = self.stopping = False
            self.held = self.cancelling = self.soft_limit = False
            self.homing = False
            self.modal = Modal()
            self.g92 = [0.0, 0.0, 0.0]
            self.mover.kill()
            self.planned = list(self.position)
            yield from self.print_line("\r\n" + self.dialect.banner)
            yield from self._main_loop()

    def _main_loop(self) -> Task:
        if self.eeprom.flag(21) and self.plant.switches():
            self.state = "Alarm"
            yield from self.print_line("[MSG:Check Limits]")
        if self.state in ("Alarm", "Sleep"):
            self.state = "Alarm"
            yield from self.print_line("[MSG:'$H'|'$X' to unlock]")
        else:
            self.state = "Idle"
            yield from startup_lines(self)
        line, skipping = "", ""
        while True:
            while self._rx:
                char = chr(self._rx.popleft())
                if char in "\r\n":
                    yield from realtime(self)
                    if self.aborted:
                        return
                    yield from self._handle(
                        "" if skipping == "over" else line, skipping
                    )
                    line, skipping = "", ""
                elif skipping:
                    if char == ")" and skipping == "(":
                        skipping = ""
                elif char in "(;":
                    skipping = char
                elif char > " " and char != "/":
                    if len(line) >= _LINE_CHARS:
                        skipping = "over"
                    else:
                        line += char.upper()
            auto_start(self)
            yield from realtime(self)
            if self.aborted:
                return
            yield math.inf if not self.flags and not self._rx else self.now_s

    def _handle(self, line: str, skipping: str) -> Task:
        code = 0
        try:
            if skipping == "over":
                code = 11
            elif line.startswith("$"):
                yield from system_line(self, line)
            elif line and self.state in ("Alarm", "Jog"):
                code = 9
            elif line:
                yield from run_order(self, read_line(line, self.modal, jog=False))
        except GcodeError as error:
            code = error.code
        yield from self.print_line(f"error:{code}" if code else "ok")
