"""JSON Schemas of the files people write, for editors that check while one types."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.files import write_text
from ..core.json import read_json

KINDS = {
    "specimen": ("magbend.core.specimen_file", "SpecimenModel"),
    "magnet": ("magbend.core.specimen_file", "MagnetModel"),
    "rig": ("magbend.rig.bench.config", "RigModel"),
    "plan": ("magbend.rig.bench.config", "PlanModel"),
    "meter": ("magbend.rig.meter.description", "MeterDescription"),
    "space": ("magbend.analysis.library.space", "Space"),
    "calibration": ("magbend.vision.camera.calibration_file", "CalibrationModel"),
    "makeable": ("magbend.analysis.design.makeable", "Makeable"),
}
"""Kind of file that people write: where its model lives."""

RECORDS = ("run", "step", "fit", "comparison")
"""Kinds of records whose schema lies beside this module, as it is."""


def toml_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file: TOML that people write, or a record.

    Parameters
    ----------
    kind : str
        One of `KINDS` or `RECORDS`.

    Raises
    ------
    InputError
        If there is no such kind.
    """
    if kind in RECORDS:
        return read_json(Path(__file__).with_name(f"{kind}.schema.json"))
    if kind not in KINDS:
        known = ", ".join([*KINDS, *RECORDS])
        what = f"no schema is called {kind!r}" if kind else "say which schema"
        raise InputError(f"{what}; there are {known}; --out writes them all")
    module, name = KINDS[kind]
    schema: dict[str, Any] = getattr(import_module(module), name).model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def write_toml_schemas(folder: Path) -> list[Path]:
    """Write every schema as ``KIND.schema.json``; return the files."""
    import json

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for kind in (*KINDS, *RECORDS):
        path = folder / f"{kind}.schema.json"
        write_text(path, json.dumps(toml_schema(kind), indent=1) + "\n")
        paths.append(path)
    return paths
