"""How the twin board moves: look-ahead planner and segments of 10 ms, as GRBL does.

Speeds in mm/s along the path, times in s. The segments are prepared ahead of their
execution, so that the reported speed and planner count lead the reported position.
Sources: gnea/grbl 1.1h ``planner.c`` and ``stepper.c`` (behaviour, not code).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

Steps = tuple[int, int, int]

BLOCKS = 15
_SEGMENTS = 5
_DT_S = 0.01
_STEPS_A_SEGMENT = 1.25


@dataclass(frozen=True, slots=True)
class Block:
    """A straight motion: steps of each axis, path length, ceilings of its axes."""

    delta: Steps
    length_mm: float
    speed_mm_s: float
    acceleration_mm_s2: float
    junction_mm_s: float


@dataclass(frozen=True, slots=True)
class _Segment:
    block: Block
    start_mm: float
    end_mm: float
    duration_s: float


class Mover:
    """Execute blocks; `step` is called for every motor motion.

    Parameters
    ----------
    step : callable
        Called as ``step(axis, count)``.
    """

    def __init__(self, step: Callable[[int, int], None]) -> None:
        self._step = step
        self.blocks: deque[Block] = deque()
        self._segments: deque[_Segment] = deque()
        self._now_s = 0.0
        self._elapsed_s = 0.0
        self._done_mm = 0.0
        self._applied = [0, 0, 0]
        self._executing: Block | None = None
        self.speed_mm_s = 0.0
        self.running = False
        self.holding = False
        self.locked = 0
        self.stalled = False

    @property
    def free_blocks(self) -> int:
        """Free places of the planner."""
        return BLOCKS - len(self.blocks)

    @property
    def prepared_mm(self) -> float:
        """Path that is already cut into segments: a hold slows down after it."""
        if not self._segments:
            return 0.0
        first = self._segments[0]
        done = min(self._elapsed_s / first.duration_s, 1.0)
        whole = sum(s.end_mm - s.start_mm for s in self._segments)
        return whole - done * (first.end_mm - first.start_mm)

    def add(self, block: Block) -> None:
        """Queue a block."""
        self.blocks.append(block)

    def start(self, now_s: float) -> None:
        """Begin, or go on, at the time `now_s`."""
        self._now_s = now_s
        self.running, self.holding = True, False
        self._prepare()

    def hold(self) -> None:
        """Slow down to a stand from the end of what is prepared."""
        self.holding = True

    def kill(self) -> None:
        """Stop at once and forget everything."""
        self.blocks.clear()
        self._segments.clear()
        self._executing = None
        self._elapsed_s = self._done_mm = self.speed_mm_s = 0.0
        self._applied = [0, 0, 0]
        self.running = self.holding = False
        self.locked = 0

    def advance(self, now_s: float) -> bool:
        """Move on to the time `now_s`; return whether the motion has just ended."""
        if not self.running:
            return False
        if self.stalled:
            self._now_s = now_s
            return False
        self._elapsed_s += now_s - self._now_s
        self._now_s = now_s
        while self._segments:
            segment = self._segments[0]
            if self._elapsed_s < segment.duration_s:
                share = self._elapsed_s / segment.duration_s
                self._execute(segment, share)
                return False
            self._execute(segment, 1.0)
            self._elapsed_s -= segment.duration_s
            self._segments.popleft()
            self._prepare()
        self.running = False
        self._elapsed_s = self.speed_mm_s = 0.0
        return True

    def _execute(self, segment: _Segment, share: float) -> None:
        block = segment.block
        if block is not self._executing:
            self._executing = block
            self._applied = [0, 0, 0]
        place = segment.start_mm + share * (segment.end_mm - segment.start_mm)
        part = min(place / block.length_mm, 1.0)
        for axis in range(3):
            due = round(block.delta[axis] * part)
            count = due - self._applied[axis]
            if count:
                self._applied[axis] = due
                if not self.locked >> axis & 1:
                    self._step(axis, count)

    def _prepare(self) -> None:
        while len(self._segments) < _SEGMENTS and self.blocks:
            block = self.blocks[0]
            if self.holding and self.speed_mm_s <= 0.0:
                return
            segment = self._next_segment(block)
            self._segments.append(segment)
            self._done_mm = segment.end_mm
            if segment.end_mm >= block.length_mm:
                self.blocks.popleft()
                self._done_mm = 0.0

    def _next_segment(self, block: Block) -> _Segment:
        """Return a segment of 10 ms, or of as many as make 1.25 steps."""
        step_mm = block.length_mm / max(max(abs(d) for d in block.delta), 1)
        start, place, time_s = self._done_mm, self._done_mm, 0.0
        exit_mm_s = self.speed_mm_s if self.holding else self._exit_speed()
        while place - start < _STEPS_A_SEGMENT * step_mm:
            speed = self._next_speed(block, block.length_mm - place, exit_mm_s)
            travel = 0.5 * (self.speed_mm_s + speed) * _DT_S
            left = block.length_mm - place
            ended = self.holding and speed <= 0.0
            if not ended and (travel >= left or travel <= 1e-9):
                mean = max(0.5 * (self.speed_mm_s + exit_mm_s), 1e-6)
                time_s += min(left / mean, 5.0 * _DT_S)
                self.speed_mm_s = exit_mm_s
                return _Segment(block, start, block.length_mm, max(time_s, 1e-4))
            place, time_s, self.speed_mm_s = place + travel, time_s + _DT_S, speed
            if ended:
                self.speed_mm_s = 0.0
                break
        return _Segment(block, start, place, time_s)

    def _next_speed(self, block: Block, left_mm: float, exit_mm_s: float) -> float:
        """Return the largest speed in 10 ms from which the exit is in reach."""
        change = block.acceleration_mm_s2 * _DT_S
        now = self.speed_mm_s
        if self.holding:
            return max(now - change, 0.0)
        reach = exit_mm_s**2 + 2.0 * block.acceleration_mm_s2 * left_mm - change * now
        fastest = 0.5 * (-change + math.sqrt(max(change**2 + 4.0 * reach, 0.0)))
        lowest = max(now - change, 0.0)
        return max(min(now + change, block.speed_mm_s, fastest), lowest)

    def _exit_speed(self) -> float:
        """Return the speed at which the first block may be left (backward pass)."""
        speed = 0.0
        for index in range(len(self.blocks) - 1, 0, -1):
            block = self.blocks[index]
            reach = math.sqrt(
                speed**2 + 2.0 * block.acceleration_mm_s2 * block.length_mm
            )
            speed = min(block.junction_mm_s, block.speed_mm_s, reach)
        return speed
