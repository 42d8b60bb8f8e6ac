"""JSON Schemas of the files people write, for editors that check while one types."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.files import write_text

KINDS = {
    "specimen": ("magbend.core.specimen_file", "SpecimenModel"),
    "magnet": ("magbend.core.specimen_file", "MagnetModel"),
    "rig": ("magbend.rig.bench.config", "RigModel"),
    "plan": ("magbend.rig.bench.config", "PlanModel"),
    "meter": ("magbend.rig.meter.description", "MeterDescription"),
    "space": ("magbend.analysis.library.space", "Space"),
    "makeable": ("magbend.analysis.design.makeable", "Makeable"),
}
"""Kind of TOML file: where its model lives."""


def toml_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of TOML file.

    Parameters
    ----------
    kind : {"specimen", "magnet", "rig", "plan", "meter", "space", "makeable"}
        Which file.

    Raises
    ------
    InputError
        If there is no such kind.
    """
    if kind not in KINDS:
        raise InputError(f"no schema is called {kind!r}; there are {', '.join(KINDS)}")
    module, name = KINDS[kind]
    schema: dict[str, Any] = getattr(import_module(module), name).model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def write_toml_schemas(folder: Path) -> list[Path]:
    """Write every schema as ``KIND.schema.json``; return the files."""
    import json

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for kind in KINDS:
        path = folder / f"{kind}.schema.json"
        write_text(path, json.dumps(toml_schema(kind), indent=1) + "\n")
        paths.append(path)
    return paths
