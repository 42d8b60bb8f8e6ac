"""The stage as people use it: gaps in mm from the magnet's N face.

The map is ``gap_mm = gap_at_zero_mm + direction * machine_mm``. Every gap is checked
here, before a byte is sent; every position is approached from the far side, so that
backlash is always taken up in the same sense.
"""

from __future__ import annotations

import logging
import math
from typing import Literal

from ...core.checks import finite
from ...core.progress import Progress, silent
from ..clock import Clock
from ..errors import InterlockError, PositionLostError, StageTimeoutError
from .config import LimitsConfig, StageConfig
from .gap_records import Approach, GapStatus, MoveRecord
from .interlock import check_feed, check_gap, check_homing, check_range
from .place import PlaceMap
from .protocol import (
    Moved,
    PositionState,
    Stage,
    StageIdentity,
    StageLimits,
)
from .stopping import StopProof

logger = logging.getLogger(__name__)

NEVER_MEASURED = (
    "the gap was never measured on this bench (gap_at_zero_mm is not in the rig file): "
    "home it, jog to a gap that you can gauge, and say it: magbend rig set-gap GAP; "
    "until then only homing and jogging move"
)
AbortPolicy = Literal["hold", "retract"]


class GapStage:
    """A stage with the gap frame, the interlock and the one-sided approach.

    Parameters
    ----------
    stage : Stage
        The raw stage, in machine mm; not yet connected.
    config : StageConfig
        Table ``[stage]`` of the rig file.
    bounds : LimitsConfig
        Table ``[limits]`` of the rig file.
    clock : Clock
        Time.
    """

    def __init__(
        self, stage: Stage, config: StageConfig, bounds: LimitsConfig, clock: Clock
    ) -> None:
        self._stage = stage
        self._config = config
        self._bounds = bounds
        self._clock = clock
        self._from_far_side = False
        self._assumed: dict[str, float] | None = None

    @property
    def identity(self) -> StageIdentity:
        """Who answers on the port, with all its settings."""
        return self._stage.identity

    @property
    def limits(self) -> StageLimits:
        """What the controller is set to."""
        return self._stage.limits

    @property
    def position_state(self) -> PositionState:
        """How far the position can be trusted."""
        return self._stage.position_state

    @property
    def place_map(self) -> PlaceMap:
        """The map by which the board's count is a gap, with all that it rests on."""
        return self._stage.place_map

    @property
    def assumed(self) -> dict[str, float] | None:
        """The operator's word that holds for this run only: gap and machine mm."""
        return self._assumed

    @property
    def is_measured(self) -> bool:
        """Whether a gap was ever measured on this bench."""
        return self._config.gap_at_zero_mm is not None

    def to_machine_mm(self, gap_mm: float) -> float:
        """Return the machine position of a gap, both in mm.

        Raises
        ------
        PositionLostError
            If the bench was never measured.
        """
        return (gap_mm - self._zero_mm()) / self._config.direction

    def to_gap_mm(self, machine_mm: float) -> float:
        """Return the gap of a machine position, both in mm.

        Raises
        ------
        PositionLostError
            If the bench was never measured.
        """
        return self._zero_mm() + self._config.direction * machine_mm

    def _zero_mm(self) -> float:
        if self._config.gap_at_zero_mm is None:
            raise PositionLostError(NEVER_MEASURED)
        return self._config.gap_at_zero_mm

    def connect(self) -> None:
        """Open the port, identify and audit the controller.

        Raises
        ------
        StageError
            If nobody answers, a setting does not fit the rig file (named in the
            sentence), the stage could not stop before it touches, or no gap of the
            limits lies within its travel.
        """
        self._stage.connect()
        try:
            self.check_feed(self._config.feed_mm_min)
            check_range(self.range_mm())
        except InterlockError:
            self._stage.close()
            raise
        self._from_far_side = False

    def home(self) -> None:
        """Find the reference; afterwards the position is ``homed``.

        Raises
        ------
        InterlockError
            If the switch lies nearer to the magnet than `min_gap_mm`: homing would
            drive the rod into it. Nothing was sent.
        StageError
            If the reference is not found.
        """
        switch_mm = self._stage.limits.switch_mm
        if switch_mm is not None and self.is_measured:
            check_homing(self.to_gap_mm(switch_mm), self._bounds)
        self._from_far_side = False
        self._stage.home()

    def assume_gap(
        self,
        gap_mm: float,
        *,
        direction: Literal[1, -1] | None = None,
        for_run: bool = False,
    ) -> float:
        """Take the operator's word that the stage stands at `gap_mm`.

        The controller's count is kept; the map moves. Without switches (``homing =
        "manual"``) the position counts as ``homed`` from here; with switches the stage
        must have been homed before.

        Parameters
        ----------
        direction : {1, -1}, optional
            Whether the gap grows or falls with the count; by default the rig file's.
        for_run : bool
            The word holds for this run only: the next command does not trust it.

        Returns
        -------
        float
            The `gap_at_zero_mm` that belongs into the rig file.

        Raises
        ------
        StageError
            If the stage is not standing, or must be homed first.
        InterlockError
            If no gap within the limits could be reached by that map.
        """
        finite(gap_mm, "gap_mm", "mm")
        machine_mm = self._stage.status().machine_mm
        if machine_mm is None:
            raise PositionLostError("the stage does not report a position; home it")
        sign = direction or self._config.direction
        gap_at_zero_mm = round(gap_mm - sign * machine_mm, 3)
        before = self._config
        self._config = before.model_copy(
            update={"gap_at_zero_mm": gap_at_zero_mm, "direction": sign}
        )
        low_mm, high_mm = self.range_mm()
        if low_mm >= high_mm:
            self._config = before
            raise InterlockError(
                f"with a gap of {gap_mm:g} mm here (direction {sign}) no gap would lie "
                f"both within the travel of the controller and from min_gap_mm = "
                f"{self._bounds.min_gap_mm:g} to max_gap_mm = "
                f"{self._bounds.max_gap_mm:g} mm; gauge it again, or correct [limits] "
                "of the rig file; nothing was changed"
            )
        try:
            self._stage.assume_homed(
                machine_mm, (gap_at_zero_mm, sign), for_run=for_run
            )
        except BaseException:
            self._config = before
            raise
        self._assumed = (
            {"gap_mm": gap_mm, "stage_mm": machine_mm} if for_run else self._assumed
        )
        self._from_far_side = False
        return gap_at_zero_mm

    def nudge(self, distance_mm: float) -> None:
        """Go at most 1 mm, slowly, from wherever the stage is (machine mm).

        For a stage that does not know where it is: nothing but the eye of whoever asks
        keeps rod and magnet apart.

        Raises
        ------
        StageError
            If it is locked or moves already, or did not end where it should.
        """
        self._from_far_side = False
        self._stage.nudge(distance_mm)

    def range_mm(self) -> tuple[float, float]:
        """Return the smallest and largest gap that may be asked for, in mm."""
        low, high = self._bounds.min_gap_mm, self._bounds.max_gap_mm
        travel = self._stage.limits.travel_mm
        if travel is not None and self.is_measured:
            ends = sorted(self.to_gap_mm(end) for end in travel)
            low, high = max(low, ends[0]), min(high, ends[1])
        return low, high

    def check_gap(self, gap_mm: float) -> None:
        """Refuse a gap that may not be visited; nothing is sent.

        Raises
        ------
        InterlockError
            If it is nearer than `min_gap_mm`, beyond `max_gap_mm`, or outside the
            travel of the controller.
        PositionLostError
            If the bench was never measured.
        """
        self._zero_mm()
        slack_mm = self._stage.limits.step_mm / 2.0
        check_gap(gap_mm, self._bounds, self.range_mm(), slack_mm)

    def check_feed(self, feed_mm_min: float) -> None:
        """Refuse a speed that the controller has not, or that leaves no room to stop.

        Raises
        ------
        InterlockError
            As it says; nothing is sent.
        """
        check_feed(feed_mm_min, self._bounds, self._stage.limits)

    def goto_gap(
        self,
        gap_mm: float,
        *,
        feed_mm_min: float | None = None,
        progress: Progress = silent,
        moved: Moved | None = None,
    ) -> MoveRecord:
        """Go to a gap, from the far side, and return when the stage stands there.

        Parameters
        ----------
        gap_mm : float
            Where to, in mm from the N face.
        feed_mm_min : float, optional
            Speed in mm/min; by default that of the rig file.
        progress : callable
            Called with legs done and legs in all.
        moved : callable, optional
            Called with the gap in mm, some times a second, on the way.

        Raises
        ------
        InterlockError
            If the gap, or the speed, is refused; nothing was sent.
        PositionLostError
            If the stage must be homed first.
        StageError
            If the move did not end where it should; the stage stands.
        """
        self.check_gap(gap_mm)
        feed = self._config.feed_mm_min if feed_mm_min is None else feed_mm_min
        self.check_feed(feed)
        self._require_homed()
        here = self._here_mm()
        legs, approach = self._legs(here, gap_mm)
        start_s = self._clock.monotonic_s()
        self._from_far_side = False
        for index, leg_mm in enumerate(legs):
            progress(index, len(legs))
            self._move(leg_mm, feed, moved)
        progress(len(legs), len(legs))
        self._from_far_side = approach == "far side"
        there = self.status()
        if there.gap_mm is None or there.stage_mm is None:
            raise PositionLostError("the stage does not report a position; home it")
        return MoveRecord(
            gap_mm=there.gap_mm,
            stage_mm=there.stage_mm,
            duration_s=self._clock.monotonic_s() - start_s,
            approach=approach,
        )

    def status(self) -> GapStatus:
        """Ask the controller where it is."""
        status = self._stage.status()
        machine = status.machine_mm
        known = self.is_measured and status.position_state != "unknown"
        return GapStatus(
            state=status.state,
            position_state=status.position_state,
            gap_mm=self.to_gap_mm(machine) if known and machine is not None else None,
            stage_mm=machine,
            feed_mm_min=status.feed_mm_min,
            alarm=status.alarm,
            pins=status.pins,
            doubt=self._stage.doubt if self.is_measured else NEVER_MEASURED,
        )

    def listen(self) -> None:
        """Take in what the controller says unasked, while the stage stands.

        Raises
        ------
        AlarmError, PositionLostError, LinkLostError
            If it raised an alarm, restarted, or is gone.
        """
        self._stage.listen()

    def stop_requested(self) -> bool:
        """Return whether ``magbend rig stop`` asks this process to stop."""
        return self._stage.stop_requested()

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold; safe from any thread."""
        self._stage.request_stop()

    def hold(self) -> StopProof:
        """Slow down, stand, forget the rest of the move; return what that took."""
        self._from_far_side = False
        return self._stage.hold()

    def stop(self) -> StopProof:
        """Stop at once; what moved is ``unverified`` afterwards."""
        self._from_far_side = False
        return self._stage.stop()

    @property
    def last_stop(self) -> StopProof | None:
        """What the last stop has shown; None before the first."""
        return self._stage.last_stop

    def abort(self, policy: AbortPolicy = "hold") -> None:
        """Hold; with the policy ``retract`` also go away from the magnet.

        Parameters
        ----------
        policy : {"hold", "retract"}
            The stage retracts (to `retract_gap_mm`, or as far as it may) only while
            its position is ``homed``; else it holds.
        """
        self.hold()
        if policy != "retract" or self.position_state != "homed":
            return
        far = self._bounds.retract_gap_mm
        target = self.range_mm()[1] if far is None else far
        here = self.status().gap_mm
        if here is not None and here < target:
            self._stage.move_to(
                self.to_machine_mm(target), feed_mm_min=self._config.feed_mm_min
            )

    def recover(self) -> None:
        """Bring the controller back after an alarm, a timeout or a lost link."""
        self._from_far_side = False
        self._stage.recover()

    def unlock(self, *, confirm: bool) -> None:
        """Lift an alarm without homing; only with the operator's word.

        Raises
        ------
        InterlockError
            If `confirm` is False.
        """
        if not confirm:
            raise InterlockError(
                "unlocking lets a stage move that does not know where it is; "
                "confirm it, or home the stage instead"
            )
        self._from_far_side = False
        self._stage.unlock()

    def close(self) -> None:
        """Let go of the port."""
        self._stage.close()

    def _here_mm(self) -> float:
        status = self._stage.status()
        if status.trouble is not None:
            raise status.trouble
        self._require_homed()
        if status.machine_mm is None:
            raise StageTimeoutError(
                "the stage does not answer; look at cable and power"
            )
        return self.to_gap_mm(status.machine_mm)

    def _move(self, gap_mm: float, feed_mm_min: float, moved: Moved | None) -> None:
        machine_mm = self.to_machine_mm(gap_mm)
        if moved is None:
            self._stage.move_to(machine_mm, feed_mm_min=feed_mm_min)
            return
        self._stage.move_to(
            machine_mm,
            feed_mm_min=feed_mm_min,
            moved=lambda place_mm: moved(self.to_gap_mm(place_mm)),
        )

    def _legs(self, here_mm: float, gap_mm: float) -> tuple[list[float], Approach]:
        """Gaps to visit in turn, so that the last motion is toward the magnet."""
        step_mm = self._stage.limits.step_mm
        backlash_mm = self._config.backlash_mm
        if math.isclose(here_mm, gap_mm, abs_tol=step_mm) and self._from_far_side:
            return [], "far side"
        if here_mm >= gap_mm + backlash_mm - step_mm and here_mm > gap_mm:
            return [gap_mm], "far side"
        beyond_mm = min(gap_mm + backlash_mm, max(self.range_mm()[1], gap_mm))
        clipped = beyond_mm < gap_mm + backlash_mm - step_mm
        legs = [gap_mm] if beyond_mm <= gap_mm else [beyond_mm, gap_mm]
        return legs, "clipped" if clipped else "far side"

    def _require_homed(self) -> None:
        if self.position_state != "homed":
            raise PositionLostError(self._stage.doubt)
