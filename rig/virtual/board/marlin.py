"""A Marlin board in software: as much as its driver asks of one.

Read in MarlinFirmware's sources: every line gets one ``ok``, for a motion when it is
queued; ``M400`` waits for the end with a keep-alive every two seconds; ``M410`` stops
at once if the build has an emergency parser, else when its turn comes. The mechanics
and the look-ahead are those of the other twin board.
"""

from __future__ import annotations

import math
import re
from collections import deque

from .line import BoardLine
from .mover import Block, Mover
from .plant import Plant

_TICK_S = 0.005
_BUSY_S = 2.0
_HOME_MM_S = 20.0
_AXES = "XYZ"


class MarlinBoard(BoardLine):
    """The board and its stage; it homes to the low switches and counts from 0 there.

    Parameters
    ----------
    plant : Plant, optional
        The mechanics: its lower switches are the end stops.
    feed_mm_s, acceleration_mm_s2, travel_mm : float
        What ``M203``, ``M201`` and ``M211`` say of every axis.
    has_emergency_parser : bool
        Whether ``M410`` is seen while another line waits.
    """

    def __init__(
        self,
        plant: Plant | None = None,
        *,
        feed_mm_s: float = 10.0,
        acceleration_mm_s2: float = 50.0,
        travel_mm: float = 180.0,
        has_emergency_parser: bool = True,
    ) -> None:
        super().__init__()
        self.plant = plant or Plant(start_mm=(-178.0,) * 3, switch_low_mm=-180.0)
        self.mover = Mover(self._on_step)
        self.position = [0, 0, 0]
        self._steps_per_mm = 250.0
        self._ceilings = (feed_mm_s, acceleration_mm_s2, travel_mm)
        self._has_parser = has_emergency_parser
        self._line = ""
        self._lines: deque[str] = deque()
        self._waits_since_s: float | None = None
        self._told_s = 0.0
        self._homing: int | None = None
        self.power_cycle(boot_s=0.5)

    def power_cycle(self, *, boot_s: float = 0.0) -> None:
        """Cut the power and give it back: the position is lost."""
        self.mover.kill()
        self._lines.clear()
        self._line, self._waits_since_s, self._homing = "", None, None
        self.position = [0, 0, 0]
        self.lose_input(boot_s)
        self.at(self.now_s + boot_s, lambda: self._say("start\necho:Marlin 2.1.2.4"))

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            step_s = _TICK_S if self.mover.running else end_s - self.now_s
            self.now_s = min(self.now_s + step_s, end_s, self._next_s())
            self.run_due()
            self.mover.advance(self.now_s)
            self._stop_at_switch()
            self._carry_on()

    def _next_s(self) -> float:
        told = self._told_s + _BUSY_S if self._waits_since_s is not None else math.inf
        return max(min(self.next_event_s(), told), self.now_s)

    def _on_byte(self, byte: int) -> None:
        if byte not in b"\r\n":
            self._line += chr(byte)
            return
        line, self._line = self._line.partition(";")[0].strip(), ""
        if self._has_parser and line == "M410":
            self.mover.kill()
        if line:
            self._lines.append(line)
            self._carry_on()

    def _carry_on(self) -> None:
        """Take the next line, unless the present one still waits for the motion."""
        if self._waits_since_s is not None:
            if self.mover.running:
                if self.now_s - self._told_s >= _BUSY_S - 1e-9:
                    self._told_s = self.now_s
                    self._say("echo:busy: processing")
                return
            self._waits_since_s = None
            self._end_homing()
            self._say("ok")
        while self._lines and self._waits_since_s is None:
            self._carry_out(self._lines.popleft())

    def _carry_out(self, line: str) -> None:
        code = line.split()[0]
        feed, acceleration, travel = self._ceilings
        answers = {
            "M115": "FIRMWARE_NAME:Marlin 2.1.2.4 MACHINE_TYPE:Stage",
            "M503": f"echo: M92 X{self._steps_per_mm:.2f} Y{self._steps_per_mm:.2f} "
            f"Z{self._steps_per_mm:.2f}\necho:  M203 X{feed:.2f} Y{feed:.2f} "
            f"Z{feed:.2f}\necho:  M201 X{acceleration:.2f} Y{acceleration:.2f} "
            f"Z{acceleration:.2f}",
            "M211": "echo:Soft endstops: On  Min: X0.00 Y0.00 Z0.00   "
            f"Max: X{travel:.2f} Y{travel:.2f} Z{travel:.2f}",
            "M114": self._place(),
            "M118": line[5:],
        }
        if code in answers:
            self._say(answers[code])
        elif code == "G28":
            self._begin_homing(line)
        elif code == "G1":
            self._queue(line)
        elif code == "M410":
            self.mover.kill()
        elif code not in ("M400", "G21", "G90", "M84"):
            self._say(f'echo:Unknown command: "{line}"')
        if code in ("M400", "G28") and self.mover.running:
            self._waits_since_s = self._told_s = self.now_s
        else:
            self._say("ok")

    def _place(self) -> str:
        mm = [steps / self._steps_per_mm for steps in self.position]
        x, y, z = self.position
        planned = " ".join(f"{a}:{p:.2f}" for a, p in zip(_AXES, mm, strict=True))
        return f"{planned} E:0.00 Count X:{x} Y:{y} Z:{z}"

    def _queue(self, line: str) -> None:
        words = dict(re.findall(r"([XYZF])(-?[\d.]+)", line))
        axis = next(a for a in words if a in _AXES)
        steps = round(float(words[axis]) * self._steps_per_mm)
        speed_mm_s = min(float(words.get("F", "60")) / 60.0, self._ceilings[0])
        self._start(_AXES.index(axis), steps, speed_mm_s)

    def _start(self, axis: int, steps: int, speed_mm_s: float) -> None:
        delta = [0, 0, 0]
        delta[axis] = steps - self.position[axis]
        if not any(delta):
            return
        self.mover.add(
            Block(
                delta=(delta[0], delta[1], delta[2]),
                length_mm=abs(delta[axis]) / self._steps_per_mm,
                speed_mm_s=speed_mm_s,
                acceleration_mm_s2=self._ceilings[1],
                junction_mm_s=0.0,
            )
        )
        self.mover.start(self.now_s)

    def _begin_homing(self, line: str) -> None:
        self._homing = next((i for i, a in enumerate(_AXES) if a in line[3:]), 0)
        far = round(1.5 * self._ceilings[2] * self._steps_per_mm)
        self._start(self._homing, self.position[self._homing] - far, _HOME_MM_S)

    def _stop_at_switch(self) -> None:
        if self._homing is not None and self.plant.switches() >> self._homing & 1:
            self.mover.kill()

    def _end_homing(self) -> None:
        if self._homing is None:
            return
        if self.plant.switches() >> self._homing & 1:
            self.position[self._homing] = 0
        else:
            self._say("Error:Homing Failed\necho:Homing failed")
        self._homing = None

    def _on_step(self, axis: int, count: int) -> None:
        self.position[axis] += count
        self.plant.step(axis, count)

    def _say(self, text: str) -> None:
        for row in text.splitlines():
            self.send(row.encode("ascii") + b"\n")
