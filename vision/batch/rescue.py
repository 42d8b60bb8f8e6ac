"""One photograph measured by hints, into tables that may be there already."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from ...core.derived import note_derived
from ...core.files import output_folder, write_bytes, write_text
from ...core.owned import owning_folder
from ..camera.oriented import oriented
from ..extraction.hints import Hints, measure_hinted, with_ruler
from ..extraction.setting import Setting
from ..measurement import Measurement
from ..picture.photo import Photo, read_photo
from .inputs import Source, digest
from .overlay import overlay_png
from .run import is_made_by_us
from .tables import (
    Done,
    done_with,
    read_centrelines,
    read_frames,
    write_centrelines,
    write_frames,
)


def rescue(
    path: Path, out: Path, setting: Setting, hints: Hints,
    *, made_with: Iterable[Path] = (),
) -> Measurement:  # fmt: skip
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
    made_with : iterable of Path
        Files behind `setting`, such as the calibration's, for the manifest.

    Returns
    -------
    Measurement
        As it was entered; failed, with a reason, if no rod is between the points: that
        replaces no row that was measured.

    Raises
    ------
    VisionError, InputError, ConfigError
        If the photograph or the tables cannot be read, or a point lies outside.
    StoreError
        If `out` is a folder of somebody else, or is being written just now.
    """
    photo = read_photo(path, linear=setting.linear)
    setting = with_ruler(photo, setting, hints)
    found = measure_hinted(photo, setting, hints)
    with owning_folder(out, "extraction", "vision points", ours=is_made_by_us):
        known = {done.row.image for done in _read(out) if done.row.ok}
        if not found.ok and path.name in known:
            return found
        made = _enter(path, out, photo, setting, hints, found)
        note_derived(made, sources=[path, *made_with], command="vision points")
    return found


def _enter(
    path: Path, out: Path, photo: Photo, setting: Setting, hints: Hints,
    found: Measurement,
) -> list[Path]:  # fmt: skip
    """Put a measurement into the tables of a folder; return the files written."""
    output_folder(out / "overlays")
    before = _read(out)
    new = done_with(
        path.name, digest(Source(image=path.name, path=path)), found,
        setting.calibration, edges=False,
    )  # fmt: skip
    new = replace(new, row=replace(new.row, hints=hints.words))
    merged = {done.row.image: done for done in before} | {path.name: new}
    frames, lines = out / "frames.csv", out / "centrelines.csv"
    drawn = out / "overlays" / f"{path.stem}.png"
    write_text(frames, write_frames(done.row for done in merged.values()))
    write_text(lines, write_centrelines(merged.values()))
    if setting.calibration is not None:
        photo = oriented(photo, setting.calibration)
    write_bytes(drawn, overlay_png(photo, found))
    return [frames, lines, drawn]


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
