"""Solve a design space into a folder of Parquet partitions, here or on a Dask cluster.

The folder explains itself:

    _library.json          the space, its digest, versions, columns; written first
    part-000000.parquet    designs 0 to partition_rows - 1, and so on
    _digests.jsonl         the digest of each partition as it was written

A partition is written beside, synced and renamed, so that it is whole or absent: a
build that was killed goes on where it stopped and repeats none that is there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import shown
from ...core.errors import InputError, MissingExtraError, StoreError
from ...core.files import write_bytes
from ...core.json import read_json, write_json
from ...core.owned import MARK, owning_folder
from ...core.progress import Progress, silent
from ...sim import ROWS_PER_CALL, STATUS, Designs, cores, solve_shapes
from ..shapes import descriptors
from .ledger import SPACE_KEY, Ledger, is_sound
from .space import Space, input_columns

Columns = dict[str, NDArray]

SCHEMA = 1
MANIFEST = "_library.json"
STATIONS = (25, 50, 75)
"""Percent of the length at which the shape is stored, beside the tip."""
POINTS = 61
ROW_GROUP = 32_768


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildSummary:
    """What a build did.

    Parameters
    ----------
    designs, partitions : int
        Of the whole library.
    solved_partitions : int
        Of these, solved by this build; the others were there.
    repaired : tuple of str
        Partitions that were there but damaged, and have been solved again.
    """

    designs: int
    partitions: int
    solved_partitions: int
    repaired: tuple[str, ...]


def build(
    space: Space,
    out: Path,
    *,
    scheduler: str | None = None,
    tls: Path | None = None,
    progress: Progress = silent,
) -> BuildSummary:
    """Solve a design space into the folder `out`, going on where a build stopped.

    Parameters
    ----------
    space : Space
    out : Path
        A new folder, or the folder of an unfinished build of the same space.
    scheduler : str, optional
        Address of a Dask scheduler whose workers see `out` under the same path. Who
        reaches it can run programs on the workers: on a trusted network only.
    tls : Path, optional
        Folder with ``ca.pem``, ``cert.pem`` and ``key.pem`` for that scheduler.
    progress : Progress
        Told in designs.

    Raises
    ------
    StoreError
        If `out` holds something else or a partition too many, another process builds
        there, or the scheduler does not answer.
    MissingExtraError
        If pyarrow, or for a cluster distributed, is not installed.
    """
    require_pyarrow()
    client = _connect(scheduler, tls) if scheduler else None
    with contextlib.ExitStack() as opened:
        if client is not None:
            opened.callback(client.close)
        opened.enter_context(
            owning_folder(
                out, "library", "analysis library build", ours=lambda path: (
                    (path / MANIFEST).is_file() and bool(read_manifest(path))
                ),
            )
        )  # fmt: skip
        _claim(space, out)
        total = partition_count(space)
        refuse_extra(out, total)
        ledger = Ledger.read(out)
        good, damaged = _finished(space, out, total, ledger)
        missing = [i for i in range(total) if i not in good]
        rows = [len(_range(space, i)) for i in range(total)]
        done = sum(rows[i] for i in good)
        progress(done, space.size)
        run = _on_cluster(client, space, out, missing) if client else _here(
            space, out, missing
        )  # fmt: skip
        for index in run:
            ledger.note(partition_path(out, index))
            done += rows[index]
            progress(done, space.size)
    return BuildSummary(
        designs=space.size,
        partitions=total,
        solved_partitions=len(missing),
        repaired=tuple(damaged),
    )


def partition_count(space: Space) -> int:
    """Return how many partitions a space has."""
    return -(-space.size // space.partition_rows)


def partition_path(out: Path, index: int) -> Path:
    """Return the path of a partition."""
    return out / f"part-{index:06d}.parquet"


def solve_partition(space: Space, out: Path, index: int) -> int:
    """Solve one partition and write it, whole or not at all; return its index."""
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    designs = _range(space, index)
    chunks = []
    for start in range(designs.start, designs.stop, ROWS_PER_CALL):
        stop = min(start + ROWS_PER_CALL, designs.stop)
        chunk: Columns = {"design": np.arange(start, stop, dtype=np.int64)}
        chunk.update(describe_designs(space.rows(start, stop), space.descriptors))
        chunks.append(chunk)
    columns: dict[str, Any] = {
        name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]
    }
    codes = pa.array(columns.pop("status"), type=pa.int8())
    columns["status"] = pa.DictionaryArray.from_arrays(codes, list(STATUS))
    table = pa.table(columns).replace_schema_metadata({SPACE_KEY: digest_of(space)})
    buffer = io.BytesIO()
    # LZ4 reads twice as fast as zstd here and is a sixth larger.
    pq.write_table(
        table, buffer, compression="lz4", row_group_size=ROW_GROUP,
        use_dictionary=_dictionaries(space), write_page_checksum=True,
        column_encoding={"design": "DELTA_BINARY_PACKED"},
    )  # fmt: skip
    write_bytes(partition_path(out, index), buffer.getvalue())
    return index


def describe_designs(designs: Designs, more: Sequence[str] = ()) -> Columns:
    """Solve designs; return the columns of their rows in the library.

    `more` names descriptors of other packages (``magbend.descriptors``).
    """
    columns = input_columns(designs)
    solved = solve_shapes(designs, points=POINTS)
    described = descriptors.describe(solved.points)
    for name, column in zip(descriptors.COLUMNS, described.T, strict=True):
        columns[name] = column.astype(np.float32)
    for name in more:
        column = descriptors.describe_by(name, solved.points)
        columns[name] = column.astype(np.float32)
    for percent in STATIONS:
        at = solved.points[:, percent * (POINTS - 1) // 100]
        columns[f"x{percent}_mm"] = at[:, 1].astype(np.float32)
        columns[f"y{percent}_mm"] = at[:, 2].astype(np.float32)
    columns["error_mm"] = solved.error_mm.astype(np.float32)
    columns["status"] = solved.status
    return columns


def require_pyarrow() -> None:
    """Raise a sentence if pyarrow is missing.

    Raises
    ------
    MissingExtraError
        If it is.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise MissingExtraError(
            "pyarrow", "library", "the prediction library"
        ) from None


def read_manifest(out: Path) -> dict[str, Any]:
    """Return ``_library.json`` of a library.

    Raises
    ------
    StoreError
        If there is none, or it is damaged.
    """
    path = out / MANIFEST
    if not path.exists():
        raise StoreError(
            f"{out}: is no prediction library ({MANIFEST} is missing); "
            "build one with `magbend analysis library build`"
        )
    try:
        manifest = read_json(path, kind=StoreError)
        schema, space = manifest["schema"], manifest["space"]
        if type(schema) is int and schema > SCHEMA:
            raise StoreError(
                f"{path}: was written by a newer magbend (format {schema}; this one "
                f"reads up to {SCHEMA}); update magbend"
            )
        if schema != SCHEMA:
            raise ValueError(f"schema {shown(schema)} is not known")
        counts = [manifest["designs"], manifest["partitions"], space["partition_rows"]]
        if not all(type(count) is int and count > 0 for count in counts):
            raise ValueError("its counts are no positive numbers")
        if manifest["digest"] != _digest(space):
            raise ValueError("its space is not the one that was built")
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{path}: is damaged: {error}") from None
    return manifest


def refuse_extra(out: Path, total: int) -> None:
    """Refuse a library with partitions that are not of its space.

    Raises
    ------
    StoreError
        It names them.
    """
    wanted = {partition_path(out, index).name for index in range(total)}
    extra = sorted({path.name for path in out.glob("part-*.parquet")} - wanted)
    if extra:
        raise StoreError(
            f"{out}: holds {', '.join(extra[:4])}, which is no part of this library; "
            f"take it out"
        )


def digest_of(space: Space) -> str:
    """Return the digest that tells a space from every other."""
    return _digest(space.model_dump(mode="json", exclude_none=True))


def _digest(data: Any) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def _range(space: Space, index: int) -> range:
    start = index * space.partition_rows
    return range(start, min(start + space.partition_rows, space.size))


def _dictionaries(space: Space) -> list[str]:
    """Columns that repeat few values, worth a dictionary."""
    names = ["status", "angle_deg", "side_mm", "remanence_mT", "flux_mT", "gap_mm"]
    for i in range(1, len(space.section) + 1):
        names += [f"length{i}_mm", f"E{i}_MPa"]
    return names if space.method == "grid" else ["status", "angle_deg"]


def _manifest(space: Space) -> dict[str, Any]:
    data = space.model_dump(mode="json", exclude_none=True)
    return {
        "schema": SCHEMA,
        "name": space.name,
        "digest": _digest(data),
        "designs": space.size,
        "partitions": partition_count(space),
        "space": data,
        "shape": f"{POINTS} points; x25_mm ... y75_mm at percent of the length",
        "radius": "least-squares circle through the whole centreline",
        "versions": {
            "python": platform.python_version(),
            **{
                name: version(name) for name in ("magbend", "numpy", "numba", "pyarrow")
            },
        },
    }


def _claim(space: Space, out: Path) -> None:
    """Write the manifest into a new folder, or check that `out` is this library.

    Raises
    ------
    StoreError
        If `out` is something else.
    """
    manifest = _manifest(space)
    if (out / MANIFEST).exists():
        if read_manifest(out)["digest"] != manifest["digest"]:
            raise StoreError(
                f"{out}: holds the library of another space; give a new --out folder"
            )
        for stale in out.glob(".part-*.tmp"):
            stale.unlink()
        return
    if any(entry.name != MARK for entry in out.iterdir()):
        raise StoreError(f"{out}: exists and is no library; give a new --out folder")
    write_json(out / MANIFEST, manifest)


def _finished(
    space: Space, out: Path, total: int, ledger: Ledger
) -> tuple[set[int], list[str]]:
    """Return which partitions are there and whole, and the names of damaged ones."""
    good, damaged = set(), []
    digest = digest_of(space)
    for index in range(total):
        path = partition_path(out, index)
        if not path.exists():
            continue
        if ledger.holds(path):
            good.add(index)
        elif path.name in ledger.digests:
            damaged.append(path.name)
        elif is_sound(space, digest, path, _range(space, index)):
            ledger.note(path)  # of a build that was cut off, or of before the ledger
            good.add(index)
        else:
            damaged.append(path.name)
    return good, damaged


def _here(space: Space, out: Path, missing: list[int]) -> Iterator[int]:
    if not missing:
        return
    with ThreadPoolExecutor(cores()) as pool:
        futures = [pool.submit(solve_partition, space, out, i) for i in missing]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _connect(address: str, tls: Path | None) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError(
            "distributed", "cluster", "building on a cluster"
        ) from None
    import logging

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=5, set_as_default=False, security=_security(tls))
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise StoreError(
            f"--scheduler {address}: no Dask scheduler answers there ({reason}); "
            "start one with `dask scheduler` or leave the option out"
        ) from None


def _security(tls: Path | None) -> Any:
    """Return what Dask encrypts and proves itself with; None for a trusted network."""
    if tls is None:
        return None
    from distributed import Security

    for name in ("ca.pem", "cert.pem", "key.pem"):
        if not (tls / name).is_file():
            raise InputError(f"--tls: {tls / name} is missing")
    return Security(
        tls_ca_file=str(tls / "ca.pem"),
        tls_client_cert=str(tls / "cert.pem"),
        tls_client_key=str(tls / "key.pem"),
        require_encryption=True,
    )


def _on_cluster(
    client: Any, space: Space, out: Path, missing: list[int]
) -> Iterable[int]:
    """Have workers solve partitions; a killed worker's tasks go to the others."""
    from distributed import as_completed as completed

    data = space.model_dump(mode="json", exclude_none=True)
    futures = client.map(
        _task, missing, data=data, out=str(out.resolve()), pure=False, retries=2
    )
    for future in completed(futures, loop=client.loop):
        if future.status != "finished":
            raise StoreError(
                f"a worker failed on a partition: {future.exception()}; the finished "
                "ones are kept, start the build again"
            )
        yield int(future.result())


def _task(index: int, *, data: dict[str, Any], out: str) -> int:
    """Solve a partition on a worker."""
    return solve_partition(Space.model_validate(data), Path(out), index)
