"""Make a run folder of somebody's photographs, readings and shapes.

The run is marked ``imported``: its table and every file it names are copied into it and
hashed, and nothing is written before all of them were read and judged.
"""

from __future__ import annotations

import getpass
import math
import socket
import uuid
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ...core.centreline import COLUMNS
from ...core.decode import read_bytes
from ...core.derived import note_derived
from ...core.door import real_path
from ...core.errors import ConfigError
from ...core.files import output_folder, write_bytes, write_text
from ...core.magnet import Magnet
from ...core.owned import owning_folder
from ...core.specimen import Specimen
from ...core.specimen_file import MagnetModel, read_specimen, specimen_dict
from ...core.toml import read_toml
from ...rig import SCHEMA, RunFolder, sha256_of, utc_now
from ...vision import Done, FrameRow, read_calibration, write_centrelines, write_frames
from ..runs import imported
from .door import read_shape
from .field_unit import check_field_unit
from .judge import Reading, Shape
from .shapes import KEPT
from .steps import StepRow, by_specimen, inside, read_steps

SOURCES = "sources"
PHOTOGRAPH_MB = 256.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedRun:
    """What was imported.

    Parameters
    ----------
    path : Path
        The run folder.
    specimen : Specimen
        Its rod.
    steps, centrelines, simulated : int
        Rows, measured shapes and simulated shapes.
    notes : tuple of str
        What was mended or taken for granted, a sentence a file.
    """

    path: Path
    specimen: Specimen
    steps: int
    centrelines: int
    simulated: int
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """One run to write: everything of it is read and judged."""

    out: Path
    name: str
    specimen: Specimen
    rows: Sequence[StepRow]
    measured: dict[int, Shape]
    simulated: dict[int, Shape]


def import_table(
    table: Path,
    out: Path,
    *,
    specimen_file: Path | None = None,
    magnet_file: Path | None = None,
    calibration_file: Path | None = None,
    how: Reading | None = None,
    name: str = "",
) -> list[ImportedRun]:
    """Make a run folder from a table with one row a step, or one for each rod in it.

    Parameters
    ----------
    table : Path
        Columns photograph or centreline, gap_mm and/or flux_mT, optionally simulated
        and specimen; further ones are kept (see `steps.read_steps`).
    out : Path
        The run folder, which must not exist; of several rods the folder of the runs.
    specimen_file : Path, optional
        The nominal rod, where the table has no column specimen.
    magnet_file : Path, optional
        The magnet, for the magnet model.
    calibration_file : Path, optional
        Of the camera; it is copied into the run.
    how : Reading, optional
        How the files of shapes are to be read.
    name : str
        Of the run; the table's name if empty.

    Raises
    ------
    ConfigError, InputError, StoreError
        If a file cannot be read, a shape does not fit, readings do not fit the magnet,
        or `out` cannot be written.
    """
    magnet = None if magnet_file is None else read_toml(magnet_file, MagnetModel)
    if calibration_file is not None:
        read_calibration(calibration_file)
    rows = read_steps(table)
    if magnet is not None:
        check_field_unit(table, rows, magnet.magnet())
    groups = by_specimen(rows)
    jobs = []
    for wanted, group in groups.items():
        file = inside(table, group[0].line, wanted) if wanted else specimen_file
        if file is None:
            raise ConfigError(
                f"{table}, line {group[0].line}: names no specimen; give --specimen, "
                "or a column specimen with the file of each row's rod"
            )
        where = out / file.stem if len(groups) > 1 else out
        title = name or (file.stem if len(groups) > 1 else table.stem)
        jobs.append(_read_job(table, where, title, file, group, magnet, how))
    for job in jobs:  # before anything is written
        if job.out.exists() and (not job.out.is_dir() or any(job.out.iterdir())):
            raise ConfigError(
                f"{job.out}: is there already and not empty; name another with --out"
            )
    return [_write(job, table, magnet, calibration_file) for job in jobs]


def _read_job(
    table: Path, out: Path, name: str, specimen_file: Path, rows: Sequence[StepRow],
    magnet: MagnetModel | None, how: Reading | None,
) -> _Job:  # fmt: skip
    specimen = read_specimen(specimen_file)
    side = _side(specimen, magnet.magnet() if magnet else None)
    return _Job(
        out=out, name=name, specimen=specimen, rows=rows,
        measured=_shapes(table, rows, "centreline", specimen, how, side),
        simulated=_shapes(table, rows, "simulated", specimen, how, side),
    )  # fmt: skip


def _write(
    job: _Job, table: Path, magnet: MagnetModel | None, calibration_file: Path | None
) -> ImportedRun:
    out, images = job.out, _image_names(job.rows)
    record = _record(table, job)
    if magnet is not None:
        record["rig"]["magnet"] = magnet.model_dump(mode="json")
    with owning_folder(out, "run", "analysis import"):
        folder = RunFolder.create(out, record, _plan_text(record))
        output_folder(out / SOURCES)
        made = [out / SOURCES / table.name]
        write_bytes(made[0], read_bytes(table))
        for index, row in enumerate(job.rows):
            shapes = (job.measured, job.simulated)
            _commit(folder, table, index, row, images[index], shapes)
        if calibration_file is not None:
            made.append(out / "calibration.json")
            write_bytes(made[-1], read_bytes(calibration_file))
        if job.measured:
            made += _write_measured(out, images, job.measured)
        if job.simulated:
            lines = {index: shape.line for index, shape in job.simulated.items()}
            made.append(out / imported.FILE)
            write_text(made[-1], imported.imported_table(lines))
        folder.finish("success", f"imported from {table.name}")
        sources = [table, *([calibration_file] if calibration_file else [])]
        note_derived(made, sources=sources, command="analysis import")
    return ImportedRun(
        path=out,
        specimen=job.specimen,
        steps=len(job.rows),
        centrelines=len(job.measured),
        simulated=len(job.simulated),
        notes=_notes([*job.measured.values(), *job.simulated.values()]),
    )


def _side(specimen: Specimen, magnet: Magnet | None) -> float:
    """Return the side to which the field bends the rod: the sign of M sin(angle)."""
    angle = math.radians(magnet.axis_angle_deg if magnet else 90.0)
    return math.copysign(1.0, specimen.remanence_mT) * math.sin(angle)


def _shapes(
    table: Path,
    rows: Sequence[StepRow],
    column: str,
    specimen: Specimen,
    how: Reading | None,
    side: float,
) -> dict[int, Shape]:
    """Return the shapes that a column names, by step."""
    found = {}
    for index, row in enumerate(rows):
        text = getattr(row, column)
        if not text:
            continue
        inside(table, row.line, text.partition("@")[0].strip())
        bent = side if math.isnan(row.flux_mT) else side * np.sign(row.flux_mT)
        found[index] = read_shape(
            text, table.parent, how, length_mm=specimen.length_mm, side=float(bent)
        )
    return found


def _image_names(rows: Sequence[StepRow]) -> list[str]:
    """Names of the pictures in the run: their own, numbered where two are alike."""
    names = [row.photograph.name if row.photograph else "" for row in rows]
    held = Counter(name.lower() for name in names)
    return [
        f"step_{i:03d}{'_' if name else ''}{name}"
        if not name or held[name.lower()] > 1
        else name
        for i, name in enumerate(names)
    ]


def _record(table: Path, job: _Job) -> dict[str, Any]:
    try:
        own = version("magbend")
    except PackageNotFoundError:
        own = "unknown"
    operator = ""
    with suppress(KeyError, OSError):
        operator = getpass.getuser()
    return {
        "schema": SCHEMA,
        "id": str(uuid.uuid4()),
        "name": job.name,
        "created_utc": utc_now(),
        "plan": {
            "name": job.name,
            "gaps_mm": [_json(row.gap_mm) for row in job.rows],
        },
        "specimen": specimen_dict(job.specimen),
        "rig": {},
        "devices": {},
        "versions": {"magbend": own},
        "host": socket.gethostname(),
        "operator": operator,
        "twin": False,
        "imported": {
            "table": f"{SOURCES}/{table.name}",
            "sha256": sha256_of(read_bytes(table)),
        },
    }


def _json(value: float) -> float | None:
    return None if math.isnan(value) else value


def _plan_text(record: dict[str, Any]) -> str:
    return (
        f"# This run was imported from {record['imported']['table']}; there was no "
        "plan.\n"
    )


def _commit(
    folder: RunFolder,
    table: Path,
    index: int,
    row: StepRow,
    image: str,
    shapes: tuple[dict[int, Shape], dict[int, Shape]],
) -> None:
    """Write one step with its picture and the files of its shapes."""
    files = {}
    if row.photograph is not None:
        files[f"images/{image}"] = read_bytes(row.photograph, PHOTOGRAPH_MB)
    for text in (row.centreline, row.simulated):
        name = text.partition("@")[0].strip()
        if name:
            path = inside(table, row.line, name)
            below = path.relative_to(real_path(table.parent))
            target = f"{SOURCES}/{below.as_posix()}"
            output_folder((folder.path / target).parent)
            files[target] = read_bytes(path)
    measured, simulated = (
        held[index].notes if index in held else () for held in shapes
    )
    flags = {*measured, *(f"simulated_{note}" for note in simulated)}
    folder.commit_step(
        {
            "index": index,
            "gap_mm": _json(row.gap_mm),
            "flux_mT": _json(row.flux_mT),
            "flux_sd_mT": _json(row.flux_sd_mT),
            "flux_status": "none" if math.isnan(row.flux_mT) else "ok",
            "image": image,
            "time_utc": utc_now(),
            "flags": sorted(flags),
            "simulated": row.simulated,
            "columns": row.others,
        },
        files,
    )


def _write_measured(
    out: Path, images: Sequence[str], shapes: dict[int, Shape]
) -> list[Path]:
    """Write frames.csv and centrelines.csv of shapes that were measured elsewhere."""
    done = []
    for index, shape in shapes.items():
        line = shape.line
        width = shape.kept.get("width_mm", np.array([math.nan]))
        known = width[np.isfinite(width)]
        frame = FrameRow(
            image=images[index], status="ok", flags=("imported", *shape.notes),
            length_mm=line.length_mm, tip_mm=line.tip_mm,
            tip_angle_deg=line.tip_angle_deg,
            clamp_angle_sd_deg=shape.direction_sd_deg,
            width_mm=float(np.median(known)) if len(known) else math.nan,
        )  # fmt: skip
        nothing = np.full(len(line.s_mm), math.nan)
        points = {name: getattr(line, name) for name in COLUMNS}
        points |= {name: shape.kept.get(name, nothing) for name in KEPT}
        done.append(Done(row=frame, sha256="", points=points))
    write_text(out / "frames.csv", write_frames(each.row for each in done))
    write_text(out / "centrelines.csv", write_centrelines(done))
    return [out / "frames.csv", out / "centrelines.csv"]


def _notes(shapes: Sequence[Shape]) -> tuple[str, ...]:
    said: dict[str, list[str]] = {}
    for shape in shapes:
        for note in shape.notes:
            said.setdefault(note, []).append(shape.source)
    return tuple(
        f"{note.replace('_', ' ')}: {sources[0]}"
        + (f" and {len(sources) - 1} more" if len(sources) > 1 else "")
        for note, sources in said.items()
    )
