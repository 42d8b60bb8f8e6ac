"""The one door for shapes from elsewhere: any file in, judged centrelines out."""

from __future__ import annotations

from pathlib import Path

from ...core.door import open_file
from ...core.errors import ConfigError, InputError
from .drawing import read_dxf, read_svg
from .judge import Reading, Shape, judged
from .readers import read_mathematica, read_matlab, read_text_shapes, read_workbook
from .shapes import Block, RawShape, case_parameters, shapes_of

MAX_SHAPES = 10_000


def read_raw_shapes(path: Path) -> list[RawShape]:
    """Return every shape of a file, as it was written; the kind is told by content.

    Raises
    ------
    ConfigError
        If the file is missing, too large, or holds no shape.
    """
    start, ending = _start(path), path.suffix.lower()
    if start.lstrip().startswith((b"<svg", b"<?xml")) or ending == ".svg":
        return read_svg(path)
    if ending == ".dxf":
        return read_dxf(path)
    shapes = [
        shape for block in _blocks(path, start, ending) for shape in shapes_of(block)
    ]
    if not shapes:
        raise ConfigError(f"{path}: holds no shape with columns x and y")
    if len(shapes) > MAX_SHAPES:
        raise ConfigError(f"{path}: holds more than {MAX_SHAPES} shapes; part it")
    return shapes


def _blocks(path: Path, start: bytes, ending: str) -> list[Block]:
    if start.startswith((b"\x89HDF", b"MATLAB")) or ending == ".mat":
        return read_matlab(path)
    if start.startswith(b"PK"):
        return _with_lines(read_workbook(path))
    if start.lstrip(b"\xef\xbb\xbf \r\n\t").startswith((b"{", b"(*")) or ending in (
        ".m",
        ".wl",
    ):
        return read_mathematica(path)
    return read_text_shapes(path)


def _with_lines(blocks: list[Block]) -> list[Block]:
    """Leave sheets out that hold no shape, as long as one does."""
    useful = []
    for block in blocks:
        try:
            shapes_of(block)
        except ConfigError:
            continue
        useful.append(block)
    return useful or blocks


def _start(path: Path) -> bytes:
    try:
        with open_file(path) as file:
            return file.read(512)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None


def read_shapes(
    path: Path,
    how: Reading | None = None,
    *,
    length_mm: float | None = None,
    side: float = 0.0,
) -> list[Shape]:
    """Return every shape of a file, judged (see `judge.judged`).

    Raises
    ------
    ConfigError, InputError
        If the file cannot be read, or a shape does not fit.
    """
    raw = read_raw_shapes(path)
    return [judged(each, how, length_mm=length_mm, side=side) for each in raw]


def read_shape(
    text: str,
    folder: Path,
    how: Reading | None = None,
    *,
    length_mm: float | None = None,
    side: float = 0.0,
) -> Shape:
    """Return one shape, named as ``FILE`` or ``FILE @ B0=0.05`` or ``FILE @ 3``.

    Parameters
    ----------
    text : str
        File, relative to `folder`, and which shape in it where there are several: its
        parameters, its name, or its number from 1.

    Raises
    ------
    ConfigError, InputError
        If it cannot be read, or does not name exactly one shape.
    """
    name, _, wanted = text.partition("@")
    path = folder / name.strip()
    found = _chosen(path, read_raw_shapes(path), wanted.strip())
    return judged(found, how, length_mm=length_mm, side=side)


def _chosen(path: Path, shapes: list[RawShape], wanted: str) -> RawShape:
    matching = shapes
    if wanted.isdecimal():
        matching = shapes[int(wanted) - 1 : int(wanted)] if int(wanted) else []
    elif wanted and "=" in wanted:
        asked = case_parameters(wanted)
        matching = [shape for shape in shapes if _has(shape, asked)]
    elif wanted:
        matching = [shape for shape in shapes if wanted in shape.source]
    if len(matching) == 1:
        return matching[0]
    names = [shape.label or shape.source.rpartition(", ")[2] for shape in shapes]
    if len(set(names)) < len(names):
        names = [str(number + 1) for number in range(len(names))]
    labels = "; ".join(names[:8])
    which = f"@ {wanted} names {len(matching)} of" if wanted else "holds"
    raise InputError(
        f"{path}: {which} {len(shapes)} shapes; name one, as in "
        f"{path.name} @ {labels.partition(';')[0] or '1'} (there are: {labels})"
    )


def _has(shape: RawShape, asked: dict[str, float]) -> bool:
    return bool(asked) and all(
        name in shape.parameters
        and abs(shape.parameters[name] - value) <= 1e-6 * max(1e-12, abs(value))
        for name, value in asked.items()
    )
