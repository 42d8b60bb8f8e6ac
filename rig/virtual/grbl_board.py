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

import heapq
import itertools
import math
from collections import deque
from collections.abc import Callable, Generator

from .board_motion import outside, plan, set_offset, target_of
from .board_report import Counters, status_report
from .gcode import GcodeError, Modal, Order, read_line
from .grbl_settings import OFFSET_ROWS, Eeprom
from .motion import Mover
from .plant import Plant

Task = Generator[float, None, None]

RX_BYTES = 128
_LINE_CHARS = 79
_BYTE_S = 10.0 / 115200.0
_TX_BYTES = 104
_TICK_S = 0.005
_PASS_S = 2e-5
_BANNER = "\r\nGrbl 1.1h ['$' for help]"
_OVERRIDES = {
    0x90: (0, 100), 0x91: (0, 10), 0x92: (0, -10), 0x93: (0, 1), 0x94: (0, -1),
}  # fmt: skip


class GrblBoard:
    """The board, its settings memory and its stage.

    Parameters
    ----------
    plant : Plant, optional
        The mechanics; by default those of the recording.
    settings : mapping of int to float, optional
        Settings that differ from the defaults of the generic build.

    Attributes
    ----------
    now_s : float
        The board's time.
    plugged, port_taken, restart_on_open : bool
        The cable is in; a program has the port open; opening restarts the board.
    latency_s : float
        Delay of everything it says.
    """

    def __init__(
        self, plant: Plant | None = None, settings: dict[int, float] | None = None
    ) -> None:
        self.plant = plant or Plant()
        self.eeprom = Eeprom(settings)
        self.now_s = 0.0
        self.mover = Mover(self._on_step)
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._out: deque[tuple[float, bytes]] = deque()
        self._rx_free_s = self._tx_free_s = self._blocked_s = 0.0
        self._deaf_until_s = self._mute_until_s = 0.0
        self.latency_s = 0.0
        self.plugged = True
        self.port_taken = False
        self.restart_on_open = False
        self.state = "Idle"
        self.position = [0, 0, 0]
        self.alarm = self.switches_seen = 0
        self.homing = False
        self.flags: set[str] = set()
        self._rx: deque[int] = deque()
        self.direction = [0.0, 0.0, 0.0]
        self._wake_s = 0.0
        self._power_up()

    # --- what the outside sees -------------------------------------------------

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self.now_s + duration_s
        while True:
            next_s = min(end_s, self._next_s())
            self._go_to(next_s)
            if next_s >= end_s:
                return

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the pace of the line."""
        for byte in data:
            self._rx_free_s = max(self.now_s, self._rx_free_s) + _BYTE_S
            self.at(self._rx_free_s, lambda byte=byte: self._on_byte(byte))  # type: ignore[misc]

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

    def power_cycle(self, *, boot_s: float = 0.0) -> None:
        """Cut the power and give it back: settings stay, the position does not.

        Parameters
        ----------
        boot_s : float
            Time of the boot loader, in which the board hears nothing.
        """
        self.mover.kill()
        self._power_up()
        self._blocked_s = self._deaf_until_s = self.now_s + boot_s

    def assume_position(self, *, locked: bool) -> None:
        """Go on from `position` as if the power had never been cut."""
        self.planned = list(self.position)
        self.state = "Alarm" if locked else "Idle"
        self.read()

    # --- time ------------------------------------------------------------------

    def _next_s(self) -> float:
        times = [self._events[0][0] if self._events else math.inf]
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
        while self._events and self._events[0][0] <= self.now_s:
            heapq.heappop(self._events)[2]()
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

    def _flag(self, name: str) -> None:
        """Set a flag and wake the main loop, wherever it waits."""
        self.flags.add(name)
        self._wake_s = min(self._wake_s, self.now_s)

    def _on_step(self, axis: int, count: int) -> None:
        self.position[axis] += count
        inverted = int(self.eeprom[3]) >> axis & 1
        self.plant.step(axis, -count if inverted else count)

    # --- reset, flags, real-time bytes -----------------------------------------

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
        if self.now_s < self._deaf_until_s:
            return
        if byte == 0x18:
            self.reset_from_anywhere()
        elif byte == 0x85:
            if self.state == "Jog":
                self._flag("cancel")
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

    def reset_from_anywhere(self) -> None:
        """Set the reset flag, as the interrupt does; a moving stage stops, alarmed."""
        if "reset" in self.flags:
            return
        self._flag("reset")
        if self.state in ("Run", "Home", "Jog") or self._stopping or self.homing:
            if not self.alarm:
                self.alarm = 6 if self.state == "Home" else 3
            self.mover.kill()

    # --- main loop ---------------------------------------------------------------

    def _firmware(self) -> Task:
        while True:
            self.overrides = [100, 100, 100]
            self.counters = Counters()
            self.flags.clear()
            self.alarm = 0
            self._rx.clear()
            self.aborted = self._suspended = self._stopping = False
            self._held = self._cancelling = self._soft_limit = False
            self.homing = False
            self.modal = Modal()
            self.g92 = [0.0, 0.0, 0.0]
            self.mover.kill()
            self.planned = list(self.position)
            yield from self.print_line(_BANNER)
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
            yield from self.startup_lines()
        line, skipping = "", ""
        while True:
            while self._rx:
                char = chr(self._rx.popleft())
                if char in "\r\n":
                    yield from self.realtime()
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
            self._auto_start()
            yield from self.realtime()
            if self.aborted:
                return
            yield math.inf if not self.flags and not self._rx else self.now_s

    def _handle(self, line: str, skipping: str) -> Task:
        code = 0
        try:
            if skipping == "over":
                code = 11
            elif line.startswith("$"):
                yield from self._system_line(line)
            elif line and self.state in ("Alarm", "Jog"):
                code = 9
            elif line:
                yield from self.run_order(read_line(line, self.modal, jog=False))
        except GcodeError as error:
            code = error.code
        yield from self.print_line(f"error:{code}" if code else "ok")

    def startup_lines(self) -> Task:
        """Run ``$N0`` and ``$N1`` and echo them."""
        for text in self.eeprom.startup:
            if text:
                yield from self.run_order(read_line(text, self.modal, jog=False))
                yield from self.print_line(f">{text}:ok")

    def print_line(self, text: str) -> Task:
        """Print a line; a full transmit buffer holds the firmware up."""
        self.send(text.encode("ascii") + b"\r\n")
        while self._tx_free_s > self.now_s + _TX_BYTES * _BYTE_S:
            yield self._tx_free_s - _TX_BYTES * _BYTE_S

    def pause(self, duration_s: float) -> Task:
        """Wait without looking at any flag."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            yield end_s

    # --- flags are looked at here, and nowhere else --------------------------------

    def realtime(self) -> Task:
        """Look at the flags; stay here while suspended."""
        yield from self._flag_pass()
        if self.state == "Sleep" and self._suspended:
            yield from self.print_line("[MSG:Sleeping]")
        while self._suspended and not self.aborted:
            yield math.inf if not self.flags and not self.alarm else self.now_s
            yield from self._flag_pass()

    def _flag_pass(self) -> Task:
        if self.alarm:
            yield from self._enter_alarm()
        if "reset" in self.flags:
            self.aborted = True
            return
        if "status" in self.flags:
            self.flags.discard("status")
            yield from self.print_line(status_report(self))
        if self.flags & {"hold", "cancel", "sleep"}:
            self._take_hold()
        if "start" in self.flags:
            self._take_start()
        if "cycle stop" in self.flags:
            self._take_cycle_stop()

    def _enter_alarm(self) -> Task:
        code, self.alarm = self.alarm, 0
        self.state = "Alarm"
        yield from self.print_line(f"ALARM:{code}")
        yield from self.pause(0.5)
        if code in (1, 2):
            yield from self.print_line("[MSG:Reset to continue]")
            self.flags.discard("reset")
            while "reset" not in self.flags:
                yield math.inf

    def _take_hold(self) -> None:
        flags = self.flags & {"hold", "cancel", "sleep"}
        self.flags -= flags
        if self.state in ("Alarm", "Check"):
            if "sleep" in flags:
                self._suspended = self._held = True
                self.state = "Sleep"
            return
        if self.state in ("Run", "Jog") and not self._cancelling:
            self.mover.hold()
            self._stopping = self._suspended = True
            self._cancelling = self.state == "Jog"
        elif self.state == "Idle":
            self._suspended = self._held = True
        if "hold" in flags and self.state not in ("Jog", "Sleep"):
            self.state = "Hold"
            self._suspended = True
        if "sleep" in flags:
            self.state = "Sleep"
            self.counters.overrides = 0  # spindle and coolant are switched off

    def _take_start(self) -> None:
        self.flags.discard("start")
        if not (self.state == "Idle" or (self.state == "Hold" and self._held)):
            return
        self._suspended = self._held = self._stopping = False
        if self.mover.blocks:
            self.state = "Run"
            self.mover.start(self.now_s)
        else:
            self.state = "Idle"

    def _take_cycle_stop(self) -> None:
        self.flags.discard("cycle stop")
        waits = self.state in ("Hold", "Sleep")
        if waits and not self._soft_limit and not self._cancelling:
            self._held = True
            self._stopping = False
            return
        if self._cancelling:
            self.mover.kill()
            self.planned = list(self.position)
        self._suspended = self._cancelling = self._stopping = False
        self.state = "Idle"

    @property
    def standing(self) -> bool:
        """Whether a hold is complete (``Hold:0``)."""
        return self._held

    @property
    def rx_free(self) -> int:
        """Free bytes of the receive buffer."""
        return RX_BYTES - len(self._rx)

    # --- motion --------------------------------------------------------------------

    def _auto_start(self) -> None:
        if self.mover.blocks and self.state == "Idle":
            self.flags.add("start")

    def _wait_until_done(self) -> Task:
        self._auto_start()
        while True:
            yield from self.realtime()
            if self.aborted or not (self.mover.blocks or self.state == "Run"):
                return
            yield math.inf if not self.flags else self.now_s

    def run_order(self, order: Order, *, jog: bool = False) -> Task:
        """Carry out one checked line."""
        if not jog:
            if order.modal.system != self.modal.system:
                self.counters.offset = 0
            self.modal = order.modal
        if order.kind == "dwell" and self.state != "Check":
            yield from self._wait_until_done()
            if not self.aborted:
                yield from self._dwell(order.seconds)
        elif order.kind in ("G92", "G92.1", "G10"):
            yield from self._wait_until_done()
            set_offset(self, order)
        elif order.kind in ("G28.1", "G30.1"):
            self.eeprom.offsets[order.kind[:3]] = self.planned_mm()
        elif order.kind in ("G28", "G30"):
            target = list(self.eeprom.offsets[order.kind])
            yield from self._line(target, order)
        elif order.kind == "move":
            target = target_of(self, order)
            if jog and self.eeprom.flag(20) and outside(self, target):
                raise GcodeError(15)
            yield from self._line(target, order, jog=jog)
        elif order.kind == "end":
            self.modal = Modal(units=self.modal.units, tool=self.modal.tool)
            yield from self.print_line("[MSG:Pgm End]")

    def _dwell(self, duration_s: float) -> Task:
        end_s = self.now_s + duration_s
        while self.now_s < end_s and not self.aborted:
            yield min(end_s, self.now_s + 0.05)
            yield from self.realtime()

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

    def _line(self, target: list[float], order: Order, *, jog: bool = False) -> Task:
        if not jog and self.eeprom.flag(20) and outside(self, target):
            yield from self._soft_limit_alarm()
            return
        if self.state == "Check":
            return
        while True:
            yield from self.realtime()
            if self.aborted:
                return
            if self.mover.free_blocks > 0:
                break
            self._auto_start()
            yield self.now_s + _TICK_S
        feed = math.inf if order.rapid else order.feed_mm_min
        plan(self, target, feed * self.overrides[0] / 100.0)
        if jog and self.state == "Idle" and self.mover.blocks:
            self.state = "Jog"
            self.mover.start(self.now_s)

    def _soft_limit_alarm(self) -> Task:
        self._soft_limit = True
        if self.state == "Run":
            self.flags.add("hold")
            while self.state != "Idle":
                yield from self.realtime()
                if self.aborted:
                    return
                yield math.inf if not self.flags else self.now_s
        self.reset_from_anywhere()
        self.alarm = 2
        yield from self.realtime()

    # --- $ lines -------------------------------------------------------------------

    def _system_line(self, line: str) -> Task:
        from .board_commands import system_line

        yield from system_line(self, line)

    def offsets_report(self) -> list[str]:
        """Return the rows of ``$#``."""
        rows = [f"[{row}:{_three(self.eeprom.offsets[row])}]" for row in OFFSET_ROWS]
        tail = ["[TLO:0.000]", "[PRB:0.000,0.000,0.000:0]"]
        return [*rows, f"[G92:{_three(self.g92)}]", *tail]


def _three(values: list[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
