"""One photograph measured by hints, into tables that may be there already."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ...core.files import output_folder, write_bytes, write_text
from ..camera.oriented import oriented
from ..extraction.hints import Hints, measure_hinted, with_ruler
from ..extraction.setting import Setting
from ..measurement import Measurement
from ..picture.photo import read_photo
from .inputs import Source, digest
from .overlay import overlay_png
from .tables import (
    Done,
    done_with,
    read_centrelines,
    read_frames,
    write_centrelines,
    write_frames,
)


def rescue(path: Path, out: Path, setting: Setting, hints: Hints) -> Measurement:
    """Measure a photograph by hints, and put its row into the tables of a folder.

    A row of the same photograph is replaced, the others stay; folder, overlay and
    tables are made where they are missing.

    Parameters
    ----------
    path : Path
        The photograph; of a run, its ``images/NAME``.
    out : Path
        Folder of ``frames.csv`` and ``centrelines.csv``.
    setting, hints
        What is known, and what a person pointed at.

    Returns
    -------
    Measurement
        As it was entered; failed, with a reason, if no rod is between the points.

    Raises
    ------
    VisionError, InputError, ConfigError
        If the photograph or the tables cannot be read, or a point lies outside.
    """
    photo = read_photo(path, linear=setting.linear)
    setting = with_ruler(photo, setting, hints)
    found = measure_hinted(photo, setting, hints)
    output_folder(out / "overlays")
    before = _read(out)
    new = done_with(
        path.name, digest(Source(image=path.name, path=path)), found,
        setting.calibration, edges=False,
    )  # fmt: skip
    new = replace(new, row=replace(new.row, hints=hints.words))
    merged = {done.row.image: done for done in before} | {path.name: new}
    write_text(out / "frames.csv", write_frames(done.row for done in merged.values()))
    write_text(out / "centrelines.csv", write_centrelines(merged.values()))
    if setting.calibration is not None:
        photo = oriented(photo, setting.calibration)
    write_bytes(out / "overlays" / f"{path.stem}.png", overlay_png(photo, found))
    return found


def _read(out: Path) -> list[Done]:
    """Return what the tables of a folder hold; nothing where there are none."""
    if not (out / "frames.csv").is_file():
        return []
    lines = {}
    if (out / "centrelines.csv").is_file():
        lines = read_centrelines(out / "centrelines.csv")
    return [
        Done(row=row, sha256="", points=lines.get(row.image, {}))
        for row in read_frames(out / "frames.csv")
    ]
