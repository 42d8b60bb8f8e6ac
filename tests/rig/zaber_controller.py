"""A two-axis Zaber controller in software: as much as a stage driver asks of one."""

from __future__ import annotations

import math

STEP_MM = 0.49609375e-3
_TICK_S = 0.002


class ZaberController:
    """Counts microsteps, keeps time; `advance` moves what moves."""

    def __init__(self, *, speed_mm_s: float = 20.0, acceleration_mm_s2: float = 50.0):
        self.now_s = 0.0
        self.plugged, self.port_taken, self.restart_on_open = True, False, False
        self.is_deaf = self.ignores_stop = False
        self.places = [30.0, 7.0]
        self.true_mm = [30.0, 7.0]
        self._speed, self._acceleration = speed_mm_s, acceleration_mm_s2
        self._feed = [speed_mm_s, speed_mm_s]
        self._target: list[float | None] = [None, None]
        self._v = [0.0, 0.0]
        self._referenced = [False, False]
        self._out, self._line = bytearray(), bytearray()

    def power_cycle(self, *, boot_s: float = 0.0) -> None:
        self.places, self._v = [0.0, 0.0], [0.0, 0.0]
        self._target, self._referenced = [None, None], [False, False]

    def read(self) -> bytes:
        data = bytes(self._out)
        self._out.clear()
        return data

    def receive(self, data: bytes) -> None:
        for byte in data:
            if byte != 10:
                self._line.append(byte)
                continue
            text = self._line.decode()
            self._line.clear()
            if not self.is_deaf:
                self._carry_out(text)

    def advance(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s - 1e-12:
            dt = min(_TICK_S, end_s - self.now_s)
            self.now_s += dt
            for axis in (0, 1):
                self._step(axis, dt)

    def _step(self, axis: int, dt: float) -> None:
        target = self._target[axis]
        if target is None:
            return
        left = target - self.places[axis]
        wanted = math.copysign(
            min(self._feed[axis], math.sqrt(2.0 * self._acceleration * abs(left))), left
        )
        change = wanted - self._v[axis]
        limit = self._acceleration * dt
        self._v[axis] += max(-limit, min(limit, change))
        way = self._v[axis] * dt
        if abs(left) <= max(abs(way), 1e-4):
            way, self._v[axis], self._target[axis] = left, 0.0, None
        self.places[axis] += way
        self.true_mm[axis] += way

    def _carry_out(self, text: str) -> None:
        _, number, *words = text.split()
        axis = int(number) - 1
        command = " ".join(words[:2])
        data = "0"
        if command == "get pos":
            data = " ".join(f"{place / STEP_MM:.0f}" for place in self.places)
        elif words[0] == "get":
            data = {
                "version": "7.34",
                "limit.min": "0",
                "limit.max": f"{150.0 / STEP_MM:.0f}",
                "maxspeed": f"{self._speed / STEP_MM * 1.6384:.0f}",
                "accel": f"{self._acceleration / STEP_MM * 1.6384e-4:.0f}",
            }[words[1]]
        elif command == "set maxspeed":
            self._feed[axis] = float(words[2]) / 1.6384 * STEP_MM
        elif command == "move abs":
            self._target[axis] = float(words[2]) * STEP_MM
        elif words[0] == "home":
            self.places[axis] = self.true_mm[axis]  # the sensor is at a true 0
            self._target[axis], self._referenced[axis] = 0.0, True
        elif words[0] == "stop" and not self.ignores_stop:
            if self._target[axis] is not None:
                v = self._v[axis]
                self._target[axis] = self.places[axis] + math.copysign(
                    v * v / (2.0 * self._acceleration), v
                )
        elif words[0] == "estop":
            self._target[axis], self._v[axis] = None, 0.0
        busy = "BUSY" if any(t is not None for t in self._target) else "IDLE"
        asked = range(2) if axis < 0 else (axis,)
        warning = "--" if all(self._referenced[i] for i in asked) else "WR"
        self._out += f"@01 {axis + 1} OK {busy} {warning} {data}\r\n".encode()
