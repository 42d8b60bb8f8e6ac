"""``_digests.jsonl`` of a library: the digest of each partition, as it was written.

One line a partition, appended by the builder that owns the folder. A partition whose
bytes are not those of its line, or that has no line, is not believed.
"""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.derived import file_digest
from ...core.door import read_file
from ...core.errors import StoreError
from ...core.json import parse_json
from .space import Space, input_columns

LEDGER = "_digests.jsonl"
SPACE_KEY = b"magbend_space"
_SAMPLED = 64


@dataclass(frozen=True, slots=True)
class Ledger:
    """The digests of a library's partitions, by file name."""

    folder: Path
    digests: dict[str, str]

    @classmethod
    def read(cls, folder: Path) -> Ledger:
        """Read what is there; a line that is damaged counts as missing."""
        digests: dict[str, str] = {}
        if (folder / LEDGER).exists():
            for line in read_file(folder / LEDGER, 256.0, StoreError).split(b"\n"):
                with contextlib.suppress(ValueError, KeyError, TypeError):
                    entry = parse_json(line)
                    digests[str(entry["part"])] = str(entry["sha256"])
        return cls(folder, digests)

    def note(self, path: Path) -> None:
        """Append the digest of a partition that was just written, or found sound."""
        digest = file_digest(path)
        self.digests[path.name] = digest
        line = json.dumps({"part": path.name, "sha256": digest})
        with (self.folder / LEDGER).open("a", encoding="ascii") as file:
            file.write(f"\n{line}\n")  # whatever was torn before ends here

    def holds(self, path: Path) -> bool:
        """Return whether a partition is byte for byte as it was noted."""
        noted = self.digests.get(path.name)
        return noted is not None and path.is_file() and file_digest(path) == noted


def is_sound(space: Space, digest: str, path: Path, rows: range) -> bool:
    """Return whether a partition without a line in the ledger can be believed.

    It is read whole with its page checksums; its designs must be those of its place,
    and the inputs of a sample of them those of the space.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            noted = (file.schema_arrow.metadata or {}).get(SPACE_KEY)
            table = file.read()
    except (pa.ArrowException, OSError):
        return False
    if noted is not None and noted.decode("ascii", "replace") != digest:
        return False
    if table.num_rows != len(rows) or "design" not in table.column_names:
        return False
    if not np.array_equal(table.column("design").to_numpy(), np.arange(*_ends(rows))):
        return False
    at = np.unique(np.linspace(0, len(rows) - 1, _SAMPLED).astype(int))
    for i in at:
        start = rows.start + int(i)
        wanted = input_columns(space.rows(start, start + 1))
        if not all(_same(table, name, int(i), one[0]) for name, one in wanted.items()):
            return False
    return True


def _ends(rows: range) -> tuple[int, int]:
    return rows.start, rows.stop


def _same(table: Any, name: str, row: int, wanted: Any) -> bool:
    if name not in table.column_names:
        return False
    return bool(np.isclose(table.column(name)[row].as_py(), wanted, rtol=1e-12))
