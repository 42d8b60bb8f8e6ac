"""A run in a printed channel: measured, its contacts flagged, held against simulation.

Writes, beside what ``vision extract`` writes, the columns of the lumen into
``centrelines.csv`` and ``frames.csv``, and ``lumen.csv`` and ``lumen.png``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...core.derived import note_derived
from ...core.errors import ConfigError
from ...core.files import write_text
from ...core.specimen_file import SpecimenModel
from ...rig import read_run
from ...sim.navigate import lumen_of
from ...vision import (
    Setting,
    extract_files,
    read_bare,
    read_calibration,
    read_centrelines,
    read_edges,
)
from ..runs.load import load_run
from .contacts import Fed, fed
from .expect import agreement, fed_mm_of, fed_steps, simulated, step_at
from .in_lumen import InLumen
from .place import place

if TYPE_CHECKING:
    import pandas as pd

COMMAND = "analysis lumen"
POINTS = ("lumen_x_mm", "lumen_y_mm", "lumen_s_mm", "wall", "wall_gap_mm",
          "wall_gap_sd_mm", "contact")  # fmt: skip
FRAMES = ("fed_mm", "contacts", "contact_walls", "contact_s_mm")
"""Columns that a lumen adds to ``centrelines.csv`` and ``frames.csv``."""


def measure_in_lumen(
    folder: Path,
    *,
    calibration: Path | None = None,
    bare: Path | None = None,
    friction: float = 0.0,
    wall_sd_mm: float = 0.0,
) -> InLumen:
    """Measure a run whose plan has a ``[lumen]``, and write its tables.

    Parameters
    ----------
    folder : Path
        The run.
    calibration, bare : Path, optional
        The camera's file, and the picture of the empty channel; by default
        ``calibration.json`` and ``bare.png`` in the run.
    friction : float
        Coefficient of friction, for the simulation.
    wall_sd_mm : float
        How far the printed walls may be off the lumen file.

    Raises
    ------
    ConfigError
        If the plan has no lumen, or a file is missing.
    VisionError
        If the channel is not to be seen, or no photograph could be measured.
    """
    record = read_run(folder).manifest
    given = (record.get("plan") or {}).get("lumen")
    if not given:
        raise ConfigError(f"{folder}: the plan of this run has no table [lumen]")
    lumen = lumen_of(given["text"])
    specimen = SpecimenModel.model_validate(record["specimen"]).specimen()
    files = calibration or folder / "calibration.json", bare or folder / "bare.png"
    if not files[1].is_file():
        raise ConfigError(
            f"{files[1]}: there is no picture of the empty channel; take one before "
            "the rod is fed in (magbend rig snapshot) and name it with --bare"
        )
    camera = read_calibration(files[0])
    placed, setting = place(
        lumen, read_bare(files[1]), camera,
        wall_height_mm=float(given["wall_height_mm"]),
        setting=Setting(calibration=camera, joints_mm=specimen.joints_mm),
        side_mm=specimen.side_mm,
    )  # fmt: skip
    edges = folder / "edges.csv"
    extract_files(
        [folder], folder, setting=setting, edges=edges, shared_clamp=False,
        made_with=files,
    )  # fmt: skip
    lines, sides = read_centrelines(folder / "centrelines.csv"), read_edges(edges)
    seen = {
        image: fed(
            lines[image], sides[image], lumen, placed, camera,
            axis_height_mm=setting.axis_height_mm, wall_sd_mm=wall_sd_mm,
        )
        for image in lines
    }  # fmt: skip
    run = load_run(folder)
    passage = simulated(run, lumen, friction)
    agreements = {}
    for step in fed_steps(run):
        expected = step_at(passage, fed_mm_of(step))
        if expected is not None and step.image in seen:
            agreements[step.image] = agreement(seen[step.image], expected)
    result = InLumen(
        run=run, lumen=lumen, placed=placed, fed=seen, passage=passage,
        agreements=agreements,
    )  # fmt: skip
    _write(folder, result, files)
    return result


def lumen_table(result: InLumen) -> pd.DataFrame:
    """Return a row a step: insertion, distances, contacts."""
    import pandas as pd

    rows = []
    for step in fed_steps(result.run):
        frame = result.run.frames.get(step.image)
        here, held = result.fed.get(step.image), result.agreements.get(step.image)
        rows.append(
            {
                "image": step.image,
                "gap_mm": step.gap_mm,
                **step.settings,
                "status": frame.status if frame else "not measured",
                "fed_mm": here.fed_mm if here else None,
                "rms_mm": held.rms_mm if held else None,
                "max_mm": held.max_mm if held else None,
                "tip_mm": held.tip_mm if held else None,
                "contacts": len(here.touches) if here else None,
                "found": held.found if held else None,
                "missed": held.missed if held else None,
                "extra": held.extra if held else None,
                "walls": ";".join(t.wall for t in here.touches) if here else "",
            }
        )
    return pd.DataFrame(rows)


def _frame_cells(seen: Fed | None) -> tuple[float | None, int | None, str, str]:
    """Return the cells of `FRAMES`."""
    if seen is None:
        return None, None, "", ""
    walls = ";".join(touch.wall for touch in seen.touches)
    places = ";".join(f"{touch.at_mm:.2f}" for touch in seen.touches)
    return seen.fed_mm, len(seen.touches), walls, places


def _write(folder: Path, result: InLumen, sources: Sequence[Path]) -> None:
    import pandas as pd

    from .figure import draw

    lines = pd.read_csv(folder / "centrelines.csv")
    frames = pd.read_csv(folder / "frames.csv")
    for image, rows in lines.groupby("image", sort=False).groups.items():
        here = result.fed[str(image)]
        columns = (
            *here.points_mm.T, here.s_mm, here.wall, here.gap_mm, here.sigma_mm,
            here.touching.astype(int),
        )  # fmt: skip
        for name, column in zip(POINTS, columns, strict=True):
            lines.loc[rows, name] = np.asarray(column)
    cells = [_frame_cells(result.fed.get(str(image))) for image in frames["image"]]
    frames[list(FRAMES)] = pd.DataFrame(cells, index=frames.index)
    written = {
        "centrelines.csv": lines, "frames.csv": frames, "lumen.csv": lumen_table(result)
    }  # fmt: skip
    for name, data in written.items():
        write_text(folder / name, data.to_csv(index=False, float_format="%.10g"))
    draw(folder / "lumen.png", result)
    made = [*(folder / name for name in written), folder / "lumen.png"]
    note_derived(made, sources=[folder / "run.json", *sources], command=COMMAND)
