"""Keep a measured gap: the map and the board it holds for, in the rig file."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from ...core.errors import InputError
from ..stage.gap import GapStage
from .file_edit import write_measured_gap

_DOUBTFUL_CHANGE_MM = 5.0
"""By more than this a gauge is more likely misread than the map is wrong."""


def why_doubt_gap(stage: GapStage, gap_mm: float) -> str:
    """Return what the map says otherwise of the gap here; empty if it agrees to 5 mm.

    The interlock moves with the map: a misread gauge moves it by as much. A stage that
    was never measured, or does not know where it is, has nothing to hold against it.
    """
    said_mm = stage.status().gap_mm
    if said_mm is None or abs(gap_mm - said_mm) <= _DOUBTFUL_CHANGE_MM:
        return ""
    return (
        f"the map said {said_mm:.1f} mm; this changes it by {gap_mm - said_mm:+.1f} "
        "mm, and the interlock with it"
    )


def keep_measured_gap(
    rig_file: Path, stage: GapStage, gap_mm: float, *, direction_tested: bool = False
) -> None:
    """Write where the stage stands, after `GapStage.assume_gap`, into the rig file.

    Parameters
    ----------
    rig_file : Path
        Its ``gap_at_zero_mm``, ``direction`` and ``[stage.measured]`` are written.
    stage : GapStage
        Connected, standing at the gap.
    gap_mm : float
        The gap that was gauged, in mm.
    direction_tested : bool
        Whether somebody saw which way the stage goes.

    Raises
    ------
    InputError
        If no gap was assumed.
    ConfigError
        If the file has no table ``[stage]`` of its own.
    """
    map_ = stage.place_map
    if map_.gap_at_zero_mm is None:
        raise InputError(
            "a gap must be assumed (GapStage.assume_gap) before it is kept"
        )
    measured = {
        "gap_mm": gap_mm,
        "machine_mm": stage.status().stage_mm,
        "direction_tested": direction_tested,
        "time_utc": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        "firmware": map_.firmware,
        "settings": dict(map_.settings),
    }
    write_measured_gap(rig_file, map_.gap_at_zero_mm, map_.direction, measured)
