"""Stop a GRBL board and prove it: jog cancel, then feed hold, then reset.

GRBL 1.1 and FluidNC cancel a jog on either of the first two; grblHAL ignores a feed
hold in the state Jog (``state_machine.c``), and every one of them ignores a jog cancel
in the state Run. A jog cancel on a board that stands does nothing, which is why it goes
first. The position survives both; a reset of a moving stage loses steps.
"""

from __future__ import annotations

from ...clock import Clock
from ...errors import NotStoppedError
from ..protocol import StageLimits
from ..stopping import BEGIN_S, MARGIN, Means, StopProof
from .motion import stands
from .protocol import FEED_HOLD, JOG_CANCEL, Report, alarm_text
from .session import GrblSession

_POLL_S = 0.05
_ASK_S = 0.3
_SILENT_S = 2.0
_STUCK_S = 1.0
_AGAIN_S = 0.1
_BUFFER_S = 0.1  # motion that is cut into steps already runs on: 0.05 to 0.1 s
_LONGEST_S = 15.0
_REPORT_STEP_MM = 0.002


class _Watch:
    """What the answers of a board show of one stop."""

    def __init__(
        self,
        session: GrblSession,
        clock: Clock,
        axis: int,
        limits: StageLimits | None = None,
        feed_mm_min: float | None = None,
    ) -> None:
        self._session = session
        self._clock = clock
        self._axis = axis
        self._limits = limits
        top = limits.max_feed_mm_min if limits else float("inf")
        self._top_mm_s = (top if feed_mm_min is None else min(feed_mm_min, top)) / 60.0
        self._last: tuple[float, float] | None = None
        self._unmoved_at_s: float | None = None
        self._unmoved_raw = ""
        self._quiet_since_s: float | None = None
        self._still_since_s: float | None = None
        self.start_s = clock.monotonic_s()
        self.was_standing = session.report is not None and stands(session.report)
        self.peak_mm_s = session.report.feed / 60.0 if session.report else 0.0
        self.first_mm: float | None = None
        self.begun_s: float | None = None
        self.tried: list[str] = []
        self.is_stuck = False

    def by(self, means: Means, byte: bytes) -> StopProof | None:
        """Try a means; return the proof, or None after noting what it lacked."""
        session, clock = self._session, self._clock
        session.realtime(byte)
        sent_s = heard_s = clock.monotonic_s()
        from_mm: float | None = None
        self._unmoved_at_s, self._unmoved_raw = None, ""
        self.begun_s = self._still_since_s = self._quiet_since_s = None
        while True:
            asked_s = clock.monotonic_s()
            report = session.ask(_ASK_S)
            if session.deaf:
                lack = f"alarm {session.alarm}"
                break
            now_s = clock.monotonic_s()
            if report is not None:
                heard_s = now_s
                if self._stands(report, now_s):
                    return self._proof(means, now_s)
                place = self._place_mm()
                from_mm = place if from_mm is None else from_mm
                lack = self._lack(report, means, asked_s - sent_s, from_mm)
                lack = lack or self._stuck(report, now_s)
                if lack:
                    break
            elif now_s - heard_s >= (BEGIN_S if byte == JOG_CANCEL else _SILENT_S):
                lack = "no answer"
                break
            clock.sleep(_POLL_S)
        self.tried.append(f"{means}: {lack}")
        return None

    def _stands(self, report: Report, now_s: float) -> bool:
        """Take an answer in; return whether two in a row said that it stands."""
        place = self._place_mm()
        if self.first_mm is None:
            self.first_mm = place
        speed = self._speed_mm_s(report, place, now_s)
        self.peak_mm_s = max(self.peak_mm_s, speed)
        slower = self.peak_mm_s - speed > self._fall_mm_s()
        slowing = slower or stands(report) or report.state == "hold"
        if slowing and self.begun_s is None:
            self.begun_s = now_s - self.start_s
        moved = self._last is not None and place != self._last[1]
        if place is not None:
            self._last = (now_s, place)
        if moved or speed > 0.0 or self._quiet_since_s is None:
            self._quiet_since_s = now_s
        if not stands(report) or moved:
            self._still_since_s = now_s if stands(report) else None
            return False
        if self._still_since_s is None:
            self._still_since_s = now_s
            return False
        return now_s - self._still_since_s >= _POLL_S

    def _lack(
        self, report: Report, means: Means, since_s: float, from_mm: float | None
    ) -> str:
        """Return what this means is found wanting in, or nothing."""
        if stands(report):
            return ""
        if means == "jog cancel" and report.state == "run":
            return "it cancels jogs alone"
        if since_s >= BEGIN_S and self.begun_s is None:
            if self._unmoved_at_s is None or report.raw == self._unmoved_raw:
                # One answer may be late, and lines hand some over twice: one more.
                self._unmoved_at_s = min(self._unmoved_at_s or since_s, since_s)
                self._unmoved_raw = report.raw if since_s < _SILENT_S else ""
            elif since_s - self._unmoved_at_s >= _AGAIN_S:
                return f"not slower after {BEGIN_S:g} s"
        place = self._place_mm()
        if place is not None and from_mm is not None and self._limits is not None:
            far_mm, allowed_mm = abs(place - from_mm), self._allowed_mm()
            if far_mm > allowed_mm:
                return f"still moving after {far_mm:.2f} mm, {allowed_mm:.2f} allowed"
        if since_s > self._longest_s():
            return f"still moving after {since_s:.1f} s"
        return ""

    def _stuck(self, report: Report, now_s: float) -> str:
        """Return that it stands but does not know it.

        Seen on grblHAL: a jog cancelled while it gathers speed stays in Jog for ever.
        """
        quiet_s = 0.0 if self._quiet_since_s is None else now_s - self._quiet_since_s
        if stands(report) or quiet_s < _STUCK_S:
            return ""
        self.is_stuck = True
        return f"the board stays in {report.state}, though nothing moves"

    def _proof(self, means: Means, now_s: float) -> StopProof:
        place, first = self._place_mm(), self.first_mm
        run_out = None if place is None or first is None else abs(place - first)
        idle = self.was_standing and not self.tried and not run_out
        return StopProof(
            means="nothing" if idle else means,
            tried=tuple(self.tried),
            begun_s=self.begun_s,
            stood_s=now_s - self.start_s,
            machine_mm=place,
            run_out_mm=run_out,
        )

    def _place_mm(self) -> float | None:
        machine = self._session.machine()
        return machine[self._axis] if machine and len(machine) > self._axis else None

    def _speed_mm_s(self, report: Report, place: float | None, now_s: float) -> float:
        """Return the speed as reported, else as the places show it."""
        if "FS" in report.fields or "F" in report.fields:
            return report.feed / 60.0
        if place is None or self._last is None or now_s <= self._last[0]:
            return 0.0
        return abs(place - self._last[1]) / (now_s - self._last[0])

    def _fall_mm_s(self) -> float:
        """Return by how much the speed must have fallen to count as slowing."""
        fall = 0.02 * self.peak_mm_s
        if self._limits is not None:
            fall = min(fall, 0.1 * self._limits.acceleration_mm_s2)
        return fall

    def _allowed_mm(self) -> float:
        if self._limits is None:
            return float("inf")
        # It may have been gathering speed, up to what it was sent with.
        gained_mm_s = self._limits.acceleration_mm_s2 * _BUFFER_S
        speed_mm_s = min(self.peak_mm_s + gained_mm_s, self._top_mm_s)
        speed_mm_s = max(speed_mm_s, self.peak_mm_s)
        stopping_mm = self._limits.stopping_mm(60.0 * speed_mm_s)
        return MARGIN * (stopping_mm + speed_mm_s * _BUFFER_S) + _REPORT_STEP_MM

    def _longest_s(self) -> float:
        if self._limits is None:
            return _LONGEST_S
        return 2.0 * self.peak_mm_s / self._limits.acceleration_mm_s2 + _SILENT_S


def stop_motion(
    session: GrblSession,
    clock: Clock,
    *,
    axis: int,
    limits: StageLimits | None = None,
    feed_mm_min: float | None = None,
) -> StopProof:
    """Bring a board to a stand and prove it; it may be left in Hold:0.

    Parameters
    ----------
    axis : int
        Which axis is looked at.
    limits : StageLimits, optional
        For the stopping distance; without them only time is judged.
    feed_mm_min : float, optional
        The speed that the motion was sent with.

    Raises
    ------
    NotStoppedError
        If it moves even after a reset, or answers none.
    """
    watch = _Watch(session, clock, axis, limits, feed_mm_min)
    proof = watch.by("jog cancel", JOG_CANCEL)
    if proof is None and not watch.is_stuck:
        proof = watch.by("feed hold", FEED_HOLD)
    return proof or reset_motion(session, clock, axis=axis, watch=watch)


def reset_motion(
    session: GrblSession, clock: Clock, *, axis: int, watch: _Watch | None = None
) -> StopProof:
    """Reset a board that may move, and prove that it stands; steps are lost then.

    Raises
    ------
    NotStoppedError
        If it moves all the same, or does not answer.
    """
    watch = watch or _Watch(session, clock, axis)
    was_standing = watch.was_standing and not watch.tried
    answered = session.reset()
    machine = session.machine()
    clock.sleep(_POLL_S)
    again = session.ask_place(_ASK_S) if answered else None
    if again is None or not stands(again) or session.machine() != machine:
        raise NotStoppedError(
            "the stage could not be proved to stand, even after a reset "
            f"({'; '.join(watch.tried) or 'no answer'}): cut the power of its motors"
        )
    place = machine[axis] if machine and len(machine) > axis else None
    alarm = session.alarm  # 3, if it moved
    stood = was_standing or watch.is_stuck  # nothing moved: no step was lost
    is_kept = stood if alarm is None else alarm_text(alarm).position_kept
    first = watch.first_mm
    return StopProof(
        means="nothing" if was_standing else "reset",
        tried=tuple(watch.tried),
        begun_s=watch.begun_s,
        stood_s=clock.monotonic_s() - watch.start_s,
        machine_mm=place,
        run_out_mm=None if place is None or first is None else abs(place - first),
        is_place_kept=is_kept,
    )
