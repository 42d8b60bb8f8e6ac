"""What a run and its centrelines hold: steps, frames, and tidy tables for notebooks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.magnet import Magnet
from ...core.notebook import Tabular, axes_or_new, plot_line
from ...core.specimen import Specimen
from ...rig import BenchModel
from ...sim import Support
from ...vision import (
    Calibration,
    Pose,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

MEASURED = ("frames.csv", "centrelines.csv", "calibration.json")
_FILES = ("run.json", "steps.jsonl", "end.json", *MEASURED)

POINT_COLUMNS = (
    "s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm", "width_mm", "sigma_mm",
    "x_px", "y_px", "good",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One finished step of a run; NaN where nothing was read.

    `imported` is a shape that another program simulated for it (see
    `analysis.imports`), None where there is none; `settings` are what other axes than
    the stage were set to.
    """

    index: int
    gap_mm: float
    flux_mT: float
    flux_sd_mT: float
    flux_status: str
    image: str
    flags: tuple[str, ...] = ()
    time_utc: str = ""
    imported: Centreline | None = field(default=None, repr=False)
    settings: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """What `magbend vision extract` found in one photograph.

    Attributes
    ----------
    image : str
        Name of the photograph.
    status, flags, reason
        ``ok`` or ``failed``, every doubt by name, and why it failed.
    points : dict of str to ndarray, shape (n,)
        `POINT_COLUMNS`; empty where it failed.
    centreline : Centreline or None
        In mm; None where it failed or has no calibration.
    sigma_mm : ndarray, shape (n,)
        Standard deviation across the line at its points, NaN where unknown.
    width_mm : float
        Median width.
    clamp_angle_sd_deg : float
        Standard deviation of the direction at the clamp, which turns the whole line;
        NaN where the table does not say.
    pose : Pose or None
        Where the specimen frame lies in the board frame.
    shared_clamp : str
        The run whose photographs gave the direction together, and share its error;
        empty where the photograph has its own.
    """

    image: str
    status: str
    flags: tuple[str, ...]
    reason: str
    points: dict[str, NDArray[np.float64]]
    centreline: Centreline | None
    sigma_mm: NDArray[np.float64]
    width_mm: float
    clamp_angle_sd_deg: float
    pose: Pose | None
    shared_clamp: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunData(Tabular):
    """A run with its centrelines.

    Attributes
    ----------
    path : Path
        The run folder.
    id, name : str
        As recorded; the name falls back to the folder's.
    specimen : Specimen
        The nominal rod.
    magnet : Magnet or None
        The nominal magnet of the rig, if it is recorded.
    steps : tuple of Step
        In the order of the run.
    frames : dict of str to Frame
        By the name of the photograph.
    calibration : Calibration or None
        If ``calibration.json`` is there.
    record, end : dict
        ``run.json`` and ``end.json`` (empty if the run was cut off).
    warnings : tuple of str
        Sentences on what is missing or doubtful.
    """

    path: Path
    id: str
    name: str
    specimen: Specimen
    magnet: Magnet | None
    steps: tuple[Step, ...]
    frames: dict[str, Frame] = field(repr=False)
    calibration: Calibration | None = field(repr=False)
    record: dict[str, Any] = field(repr=False)
    end: dict[str, Any] = field(repr=False)
    warnings: tuple[str, ...]

    @property
    def label(self) -> str:
        """Name of the run folder: what tells runs apart in tables."""
        return self.path.resolve().name

    @property
    def support(self) -> Support:
        """Weight as ``[bench]`` of the rig file tells it; none without a density."""
        bench = (self.record.get("rig") or {}).get("bench")
        if not bench:
            return Support()
        model = BenchModel.model_validate(bench)
        return Support(gravity_m_s2=model.gravity_m_s2(self.specimen))

    @property
    def steps_table(self) -> pd.DataFrame:
        """One row a step: run, step, gap_mm, flux_mT, ..., frame status."""
        import pandas as pd

        rows = []
        for step in self.steps:
            frame = self.frames.get(step.image)
            rows.append(
                {
                    "run": self.label,
                    "step": step.index,
                    "gap_mm": step.gap_mm,
                    "flux_mT": step.flux_mT,
                    "flux_sd_mT": step.flux_sd_mT,
                    "flux_status": step.flux_status,
                    "image": step.image,
                    "frame_status": frame.status if frame else "missing",
                    "time_utc": step.time_utc,
                }
            )
        return pd.DataFrame(rows)

    @property
    def frames_table(self) -> pd.DataFrame:
        """One row a photograph: image, status, length_mm, tip, width_mm, ..."""
        import pandas as pd

        rows = []
        for frame in self.frames.values():
            line = frame.centreline
            rows.append(
                {
                    "run": self.label,
                    "image": frame.image,
                    "status": frame.status,
                    "flags": " ".join(frame.flags),
                    "reason": frame.reason,
                    "length_mm": line.length_mm if line else math.nan,
                    "tip_x_mm": line.tip_mm[0] if line else math.nan,
                    "tip_y_mm": line.tip_mm[1] if line else math.nan,
                    "tip_angle_deg": line.tip_angle_deg if line else math.nan,
                    "width_mm": frame.width_mm,
                }
            )
        return pd.DataFrame(rows)

    @property
    def points_table(self) -> pd.DataFrame:
        """One row a point: run, step, gap_mm, flux_mT, image, s_mm, x_mm, y_mm, ..."""
        import pandas as pd

        tables = []
        for step in self.steps:
            frame = self.frames.get(step.image)
            if frame is None or not frame.points:
                continue
            table = pd.DataFrame(frame.points)
            table.insert(0, "image", step.image)
            table.insert(0, "flux_mT", step.flux_mT)
            table.insert(0, "gap_mm", step.gap_mm)
            table.insert(0, "step", step.index)
            table.insert(0, "run", self.label)
            tables.append(table)
        if not tables:
            names = ("run", "step", "gap_mm", "flux_mT", "image", *POINT_COLUMNS)
            return pd.DataFrame(columns=list(names))
        return pd.concat(tables, ignore_index=True)

    @property
    def files(self) -> list[Path]:
        """The files that were read, for those who note what a result was made from."""
        return [path for name in _FILES if (path := self.path / name).is_file()]

    def to_dataframe(self) -> pd.DataFrame:
        """Return every measured point, a row each: `points_table`."""
        return self.points_table

    def _repr_html_(self) -> str:
        steps = self.steps_table.to_html(
            index=False, border=0, float_format="{:.5g}".format
        )
        return f"<p>{escape(self.name)}: {escape(self.specimen.name)}</p>{steps}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the measured lines into `ax`, or into new axes; return them."""
        ax = axes_or_new(ax, "x (mm)", "y (mm)")
        for step in self.steps:
            frame = self.frame(step)
            if frame is not None and frame.centreline is not None:
                name = f"{step.flux_mT:.3g} mT, {step.gap_mm:g} mm"
                plot_line(ax, frame.centreline, label=name)
        ax.legend()
        return ax

    def frame(self, step: Step) -> Frame | None:
        """Return what was found in the photograph of `step`, None if not looked at."""
        return self.frames.get(step.image)
