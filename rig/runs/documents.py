"""A run as documents of bluesky's event model: start, descriptor, events, stop.

One JSON pair ``[name, document]`` a line, as bluesky's own JSON writers have it; tools
that read such documents read these. Photographs stay files: an event holds their path
inside the run folder. Source: bluesky/event-model, ``schemas``.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from ...core.files import write_text
from .read import Run
from .records import Record

Document = tuple[str, dict[str, Any]]

_NUMBERS = {
    "gap": ("gap_reached_mm", "mm", "stage", 3),
    "stage": ("stage_mm", "mm", "stage", 3),
    "flux_density": ("flux_mT", "mT", "meter", 4),
    "flux_density_sd": ("flux_sd_mT", "mT", "meter", 4),
    "brightness": ("brightness", "", "camera", 4),
}
_WORDS = {"kind": "kind", "settle": "settle", "flags": "flags"}


def documents_of(run: Run) -> Iterator[Document]:
    """Yield the documents of a run, in order.

    Identifiers follow from that of the run: the same run gives the same documents.
    """
    manifest = run.manifest
    start_id = str(manifest["id"])
    yield "start", _start(run, start_id)
    descriptor_id = _derived(start_id, "primary")
    yield "descriptor", _descriptor(run, start_id, descriptor_id)
    for number, step in enumerate(run.steps, start=1):
        yield "event", _event(step, number, start_id, descriptor_id)
    yield "stop", _stop(run, start_id)


def write_documents(run: Run, path: Path) -> int:
    """Write the documents as lines of JSON; return how many there are.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    lines = [json.dumps(pair, ensure_ascii=False) for pair in documents_of(run)]
    write_text(path, "\n".join(lines) + "\n")
    return len(lines)


def _derived(start_id: str, name: str) -> str:
    return str(uuid.uuid5(uuid.UUID(start_id), name))


def _seconds(text: Any, default: float = 0.0) -> float:
    """Return seconds since 1970 of a time in UTC."""
    try:
        return datetime.fromisoformat(str(text).replace("Z", "+00:00")).timestamp()
    except ValueError:
        return default


def _start(run: Run, start_id: str) -> dict[str, Any]:
    manifest = run.manifest
    return {
        "uid": start_id,
        "time": _seconds(manifest.get("created_utc")),
        "plan_name": "magbend rig run",
        "plan_type": "run",
        "plan_args": manifest.get("plan", {}),
        "sample": manifest.get("specimen", {}),
        "owner": str(manifest.get("operator", "")),
        "num_points": len(manifest.get("plan", {}).get("gaps_mm", [])),
        "motors": ["gap"],
        "magbend": {
            key: manifest.get(key) for key in ("name", "rig", "map", "versions", "twin")
        },
    }


def _descriptor(run: Run, start_id: str, descriptor_id: str) -> dict[str, Any]:
    keys: dict[str, Any] = {}
    for name, (_, unit, source, precision) in _NUMBERS.items():
        keys[name] = {
            "source": f"magbend:{source}", "dtype": "number", "shape": [],
            "units": unit, "precision": precision, "object_name": source,
        }  # fmt: skip
    for name in (*_WORDS, "photograph"):
        source = "camera" if name == "photograph" else "run"
        keys[name] = {
            "source": f"magbend:{source}", "dtype": "string", "shape": [],
            "object_name": source,
        }  # fmt: skip
    objects: dict[str, list[str]] = {}
    for name, key in keys.items():
        objects.setdefault(key["object_name"], []).append(name)
    time_s = _seconds(run.manifest.get("created_utc"))
    return {
        "uid": descriptor_id,
        "run_start": start_id,
        "time": time_s,
        "name": "primary",
        "data_keys": keys,
        "object_keys": objects,
        "hints": {"stage": {"fields": ["gap"]}, "meter": {"fields": ["flux_density"]}},
        "configuration": {
            name: _configuration(name, device, time_s)
            for name, device in run.manifest.get("devices", {}).items()
            if isinstance(device, dict)
        },
    }


def _configuration(name: str, device: Record, time_s: float) -> dict[str, Any]:
    text = json.dumps(device, ensure_ascii=False, sort_keys=True)
    key = f"{name}_identity"
    return {
        "data": {key: text},
        "timestamps": {key: time_s},
        "data_keys": {
            key: {"source": f"magbend:{name}", "dtype": "string", "shape": []}
        },
    }


def _event(
    step: Record, number: int, start_id: str, descriptor_id: str
) -> dict[str, Any]:
    data: dict[str, Any] = {name: step.get(key) for name, (key, *_) in _NUMBERS.items()}
    data["kind"] = str(step.get("kind", "approach"))
    data["settle"] = str(step.get("settle", {}).get("status", ""))
    data["flags"] = " ".join(step.get("flags") or [])
    files = step.get("files") or [{}]
    data["photograph"] = str(files[0].get("path", ""))
    time_s = _seconds(step.get("time_utc"))
    return {
        "uid": _derived(start_id, f"step {step['index']}"),
        "descriptor": descriptor_id,
        "time": time_s,
        "seq_num": number,
        "data": data,
        "timestamps": dict.fromkeys(data, time_s),
    }


def _stop(run: Run, start_id: str) -> dict[str, Any]:
    end = run.end or {"status": "fail", "reason": "the run was cut off"}
    last = run.steps[-1].get("time_utc") if run.steps else None
    began_s = _seconds(run.manifest.get("created_utc"))
    return {
        "uid": _derived(start_id, "stop"),
        "run_start": start_id,
        "time": _seconds(end.get("time_utc"), _seconds(last, began_s)),
        "exit_status": str(end["status"]),
        "reason": str(end.get("reason", "")),
        "num_events": {"primary": len(run.steps)},
    }
