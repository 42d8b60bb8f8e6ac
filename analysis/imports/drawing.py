"""Polylines of drawings: DXF and SVG, as traced over a photograph or drawn by hand.

Only what a traced curve needs is read: polylines, lines, and the paths of an SVG with
straight and cubic pieces. Anything else is refused by name, never guessed.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...core.columns import parse_number
from ...core.decode import decode_text, read_bytes
from ...core.errors import ConfigError
from .shapes import Array, RawShape

LIMIT_MB = 16.0
_DXF_UNITS = {1: "in", 4: "mm", 5: "cm", 6: "m", 13: "um"}
_ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "Z": 0}
_PER_CURVE = 16


def read_dxf(path: Path) -> list[RawShape]:
    """Read the polylines of a DXF (LWPOLYLINE, POLYLINE, LINE); units by $INSUNITS.

    Raises
    ------
    ConfigError
        If it is no DXF, or has no polyline.
    """
    lines = decode_text(read_bytes(path, LIMIT_MB), path).splitlines()
    pairs = list(
        zip(map(str.strip, lines[::2]), map(str.strip, lines[1::2]), strict=False)
    )
    if not pairs or not all(code.lstrip("-").isdecimal() for code, _ in pairs[:50]):
        raise ConfigError(f"{path}: is no DXF text (binary DXF: save it as ASCII)")
    unit = ""
    for (_, name), (code, value) in itertools.pairwise(pairs):
        if name == "$INSUNITS" and code == "70":
            unit = _DXF_UNITS.get(int(parse_number(value) or 0), "")
    found = [points for points in _dxf_polylines(path, pairs) if len(points) >= 2]
    if not found:
        raise ConfigError(
            f"{path}: has no polyline; explode splines and arcs into polylines"
        )
    return [
        RawShape(source=_named(path, i, found), points=points, unit=unit)
        for i, points in enumerate(found)
    ]


def _dxf_polylines(path: Path, pairs: list[tuple[str, str]]) -> Iterator[Array]:
    """Yield each polyline, and lines that join end to end as one."""
    chain: list[list[float]] = []
    points: list[list[float]] = []
    kind = ""
    for code, value in [*pairs, ("0", "EOF")]:
        if code == "0":
            if kind == "LWPOLYLINE":
                yield np.array(points)
            elif kind == "LINE" and len(points) == 2:
                if chain and math.dist(chain[-1], points[0]) > 1e-9:
                    yield np.array(chain)
                    chain = []
                chain += points if not chain else points[1:]
            if value == "SEQEND":
                yield np.array(points)
            if value in ("SPLINE", "ARC", "ELLIPSE"):
                raise ConfigError(
                    f"{path}: holds a {value}; explode it into a polyline first"
                )
            if value != "VERTEX":
                points = []
            kind = value
        elif code in ("10", "20", "11", "21") and kind in (
            "LWPOLYLINE",
            "VERTEX",
            "LINE",
        ):
            number = parse_number(value)
            if number is None:
                raise ConfigError(f"{path}: {value!r} is no coordinate")
            if code[0] == "1":
                points.append([number, 0.0])
            elif points:
                points[-1][1] = number
        elif code == "42" and kind in ("LWPOLYLINE", "VERTEX") and parse_number(value):
            raise ConfigError(f"{path}: a polyline has arcs (bulges); explode it first")
    if chain:
        yield np.array(chain)


def read_svg(path: Path) -> list[RawShape]:
    """Read the polylines and paths of an SVG; y is turned up, mm by width and viewBox.

    Raises
    ------
    ConfigError
        If it is no SVG, has no line, or one under a transform.
    """
    text = decode_text(read_bytes(path, LIMIT_MB), path)
    if "<!ENTITY" in text:
        raise ConfigError(
            f"{path}: an SVG must not define entities; save it as plain SVG"
        )
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ConfigError(f"{path}: is no SVG: {error}") from None
    found = list(_svg_lines(path, root, False))
    if not found:
        raise ConfigError(f"{path}: has no polyline and no path")
    scale, unit = _svg_scale(root)
    upright = np.array([scale, -scale])
    return [
        RawShape(source=_named(path, i, found), points=points * upright, unit=unit)
        for i, points in enumerate(found)
    ]


def _svg_lines(
    path: Path, node: ElementTree.Element, is_moved: bool
) -> Iterator[Array]:
    is_moved = is_moved or "transform" in node.attrib
    tag = node.tag.rpartition("}")[2] if isinstance(node.tag, str) else ""
    if tag in ("polyline", "path", "line") and is_moved:
        raise ConfigError(
            f"{path}: a {tag} lies under a transform; apply it (ungroup) and save again"
        )
    if tag in ("defs", "clipPath", "symbol"):
        return
    if tag == "polyline":
        values = _numbers(path, node.get("points", ""))
        yield np.array(values[: len(values) // 2 * 2]).reshape(-1, 2)
    elif tag == "line":
        ends = [
            _numbers(path, node.get(key, "0"))[0] for key in ("x1", "y1", "x2", "y2")
        ]
        yield np.array(ends).reshape(2, 2)
    elif tag == "path":
        yield from _svg_path(path, node.get("d", ""))
    for child in node:
        yield from _svg_lines(path, child, is_moved)


def _svg_path(path: Path, text: str) -> Iterator[Array]:
    """Yield each part of a path; a cubic piece gives sixteen points."""
    points: list[Array] = []
    at = np.zeros(2)
    for letter, rest in re.findall(r"([A-DF-Za-df-z])([^A-DF-Za-df-z]*)", text):
        command = letter.upper()
        if command not in _ARGUMENTS:
            raise ConfigError(
                f"{path}: a path has the command {letter!r}; convert it to lines"
            )
        values, count = _numbers(path, rest), _ARGUMENTS[command]
        for k in range(0, len(values), count or 1):
            start = at if letter.islower() else np.zeros(2)
            part = values[k : k + count]
            if len(part) < count:
                raise ConfigError(f"{path}: a path is cut off after {letter!r}")
            if command == "M" and k == 0:
                if len(points) > 1:
                    yield np.array(points)
                points = []
            if command in "ML":
                new = [start + part]
            elif command == "H":
                new = [np.array([start[0] + part[0], at[1]])]
            elif command == "V":
                new = [np.array([at[0], start[1] + part[0]])]
            else:
                new = _cubic(at, start + np.reshape(part, (3, 2)))
            points += new
            at = points[-1]
    if len(points) > 1:
        yield np.array(points)


def _cubic(start: Array, controls: Array) -> list[Array]:
    a, b, c = controls
    return [
        (1 - t) ** 3 * start
        + 3 * (1 - t) ** 2 * t * a
        + 3 * (1 - t) * t**2 * b
        + t**3 * c
        for t in np.linspace(0.0, 1.0, _PER_CURVE + 1)[1:]
    ]


def _numbers(path: Path, text: str) -> list[float]:
    parts = re.findall(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", text)
    values = [parse_number(part) for part in parts]
    if not all(value is not None for value in values):
        raise ConfigError(f"{path}: a coordinate is no finite number")
    return [value for value in values if value is not None]


def _svg_scale(root: ElementTree.Element) -> tuple[float, str]:
    """Return mm a user unit, from width in mm and viewBox; px where it has none."""
    width = re.fullmatch(r"\s*([\d.]+)\s*(mm|cm|in)\s*", root.get("width", ""))
    box = re.split(r"[\s,]+", root.get("viewBox", "").strip())
    if not width or len(box) != 4 or not parse_number(box[2]):
        return 1.0, ""
    factor = {"mm": 1.0, "cm": 10.0, "in": 25.4}[width.group(2)]
    return factor * float(width.group(1)) / float(box[2]), "mm"


def _named(path: Path, index: int, found: list[Array]) -> str:
    return str(path) if len(found) == 1 else f"{path}, line {index + 1}"
