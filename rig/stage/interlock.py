"""What keeps rod and magnet apart: refusals on the host, before a byte is sent."""

from __future__ import annotations

from ...core.checks import finite
from ..errors import InterlockError
from .config import LimitsConfig
from .protocol import StageLimits

Range = tuple[float, float]


def check_gap(
    gap_mm: float, bounds: LimitsConfig, travel_mm: Range, slack_mm: float
) -> None:
    """Refuse a gap that may not be visited.

    Parameters
    ----------
    gap_mm : float
        The gap asked for.
    bounds : LimitsConfig
        Table ``[limits]`` of the rig file.
    travel_mm : tuple of float
        Smallest and largest gap that the controller can reach within `bounds`.
    slack_mm : float
        How far rounding may lead beyond the travel.

    Raises
    ------
    InterlockError
        If it is nearer than `min_gap_mm`, beyond `max_gap_mm`, or outside the travel.
    """
    finite(gap_mm, "gap_mm", "mm")
    if gap_mm < bounds.min_gap_mm:
        raise InterlockError(
            f"gap_mm must be at least {bounds.min_gap_mm:g} mm (limits.min_gap_mm "
            f"of the rig file); instead received {gap_mm:g} mm; nothing was sent"
        )
    if gap_mm > bounds.max_gap_mm:
        raise InterlockError(
            f"gap_mm must be at most {bounds.max_gap_mm:g} mm (limits.max_gap_mm "
            f"of the rig file); instead received {gap_mm:g} mm; nothing was sent"
        )
    low, high = travel_mm
    if not low - slack_mm <= gap_mm <= high + slack_mm:
        raise InterlockError(
            f"gap_mm must be from {low:g} to {high:g} mm, which is the travel of "
            f"the controller; instead received {gap_mm:g} mm; nothing was sent"
        )


def check_range(range_mm: Range) -> None:
    """Refuse a map by which no gap lies both in the limits and in the travel.

    Raises
    ------
    InterlockError
        As it says.
    """
    low, high = range_mm
    if low >= high:
        raise InterlockError(
            f"no gap lies within the travel of the controller and the limits of the "
            f"rig file (from {low:g} to {high:g} mm); correct gap_at_zero_mm and "
            "direction in the rig file, or its [limits]"
        )


def check_homing(switch_gap_mm: float, bounds: LimitsConfig) -> None:
    """Refuse homing toward the magnet.

    Raises
    ------
    InterlockError
        If the switch lies nearer than `min_gap_mm`.
    """
    if switch_gap_mm < bounds.min_gap_mm:
        raise InterlockError(
            f"homing would drive the stage to a gap of {switch_gap_mm:g} mm, nearer "
            f"than min_gap_mm = {bounds.min_gap_mm:g} mm; home away from "
            "the magnet ($23 on GRBL), or correct gap_at_zero_mm and direction "
            "in the rig file; nothing was sent"
        )


def check_feed(feed_mm_min: float, bounds: LimitsConfig, limits: StageLimits) -> None:
    """Refuse a speed that the board has not, or that leaves no room to stop.

    Raises
    ------
    InterlockError
        If the stage cannot stop from it between `min_gap_mm` and `contact_gap_mm`.
    """
    finite(feed_mm_min, "feed_mm_min", "mm/min")
    if not 0.0 < feed_mm_min <= limits.max_feed_mm_min:
        raise InterlockError(
            f"feed_mm_min must be above zero and at most the controller's "
            f"{limits.max_feed_mm_min:g} mm/min; instead received {feed_mm_min:g}"
        )
    room_mm = bounds.min_gap_mm - bounds.contact_gap_mm
    needed_mm = limits.stopping_mm(feed_mm_min)
    if needed_mm > room_mm:
        raise InterlockError(
            f"at {feed_mm_min:g} mm/min and the board's acceleration of "
            f"{limits.acceleration_mm_s2:g} mm/s2 ($120-$122 on GRBL, M201 on Marlin) "
            f"the stage needs {needed_mm:.2f} mm to stop, but min_gap_mm is only "
            f"{room_mm:g} mm before contact_gap_mm; lower feed_mm_min, raise "
            "min_gap_mm or the acceleration"
        )
