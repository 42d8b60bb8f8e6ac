"""What a run writes down, as plain data: step records, files, hashes, times.

The folder is described in DESIGN, section 4; `runs.folder` writes it, `runs.read` reads
it and `verify` checks it. Nothing here touches a device.
"""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime
from typing import Any

RUN_FILE = "run.json"
PLAN_FILE = "plan.toml"
STEPS_FILE = "steps.jsonl"
STEP_TABLE_FILE = "steps.csv"
END_FILE = "end.json"
AMENDMENTS_FILE = "amendments.jsonl"
SESSIONS_FILE = "sessions.jsonl"
WIRE_FILE = "wire.log"
IMAGES = "images"
SCHEMA = 2
"""1: until 0.1. 2: records carry seals, lines are chained (``magbend migrate``)."""

Record = dict[str, Any]
"""One JSON object: a step, a session, the manifest."""


def utc_now() -> str:
    """Return the time of day in UTC, ISO 8601 with milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def sha256_of(data: bytes) -> str:
    """Return the SHA-256 of `data` as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def image_name(index: int) -> str:
    """Return the path of a step's photograph inside the run folder."""
    return f"{IMAGES}/step_{index:03d}.png"
