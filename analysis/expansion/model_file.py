"""Model files: arrays and a JSON card in one ``.npz``, never a pickle."""

from __future__ import annotations

import io
import json
import zlib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from ...core.door import MEGABYTE, read_file
from ...core.errors import StoreError
from ...core.files import write_bytes
from ...core.json import parse_json

_MOST_MB = 256.0
_MOST_ARRAYS = 500

DAMAGE = (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile, zlib.error)
"""What reading a damaged file may raise."""


def write_model(path: Path, arrays: dict[str, Any], card: dict[str, Any]) -> None:
    """Write arrays and a card, whole or not at all."""
    text = json.dumps(card, allow_nan=False).encode()
    buffer = io.BytesIO()
    np.savez_compressed(buffer, card=np.frombuffer(text, dtype=np.uint8), **arrays)
    write_bytes(path, buffer.getvalue())


def read_model(path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Return arrays and card.

    Raises
    ------
    StoreError
        If there is no such file.
    OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile, zlib.error
        If it is damaged (`DAMAGE`).
    """
    content = read_file(path, _MOST_MB, StoreError)
    with ZipFile(io.BytesIO(content)) as entries:
        if sum(entry.file_size for entry in entries.infolist()) > _MOST_MB * MEGABYTE:
            raise ValueError("it unpacks to more than any model")
        if len(entries.infolist()) > _MOST_ARRAYS:
            raise ValueError("it holds more arrays than any model")
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, array in arrays.items():
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{name} holds numbers that are not finite")
    return arrays, parse_json(arrays.pop("card").tobytes())


def damaged(path: Path, what: str, error: Exception, way_out: str) -> StoreError:
    """Return the sentence for a damaged file."""
    reason = " ".join(str(error).split())[:120] or type(error).__name__
    if "pickle" in reason:
        reason = "it is no NumPy archive"
    elif isinstance(error, KeyError):
        reason = f"the entry {reason} is missing"
    elif isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    return StoreError(
        f"{path}: is damaged or no {what} ({reason}); make it again with `{way_out}`"
    )
