"""Shapes as other programs write them: each read right, or refused with the change."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from magbend.analysis.imports.door import read_shape, read_shapes
from magbend.analysis.imports.judge import Reading
from magbend.core.centreline import Centreline
from magbend.core.errors import ConfigError, InputError
from magbend.sim import UniformField, gmc, solve

ROD = gmc(2)
LENGTH_MM = ROD.length_mm


def shape(flux_mT: float = 50.0, points: int = 61) -> Centreline:
    line = solve(ROD, UniformField(flux_mT=flux_mT), points=points).centreline
    assert line is not None
    return line


LINE = shape()
XY = LINE.points_mm
RNG = np.random.default_rng(16)


def text(rows: np.ndarray, head: str = "", sep: str = ",") -> str:
    body = "\n".join(sep.join(f"{value:.12g}" for value in row) for row in rows)
    return f"{head}\n{body}\n" if head else f"{body}\n"


def columns(*values: np.ndarray) -> np.ndarray:
    return np.column_stack(values)


COMSOL = (
    "% Model:              rod.mph\n% Version:            COMSOL 6.1.0.282\n"
    "% Date:               Jan 1 2026, 10:00\n% Dimension:          2\n"
    "% Nodes:              61\n% Expressions:        2\n% Description:        x, y\n"
)


def comsol(
    unit: str, factor: float, order: np.ndarray | None = None, sep: str = "   "
) -> str:
    """A spreadsheet export over material coordinates, in the solver's order."""
    rows = columns(LINE.s_mm, 0.0 * LINE.s_mm, XY) * factor
    rows = rows if order is None else rows[order]
    head = f"% X{sep}Y{sep}x ({unit}){sep}y ({unit})"
    return f"{COMSOL}% Length unit:        {unit}\n{text(rows, head, sep)}"


def comsol_sweep(sep: str) -> str:
    lines = [shape(flux_mT) for flux_mT in (20.0, 50.0, 80.0)]
    heads = ["X (m)"]
    rows = [LINE.s_mm * 1e-3]
    for flux_T, line in zip((0.02, 0.05, 0.08), lines, strict=True):
        heads += [f"x (m) @ B0={flux_T:g}", f"y (m) @ B0={flux_T:g}"]
        rows += [line.x_mm * 1e-3, line.y_mm * 1e-3]
    return COMSOL + text(columns(*rows), "% " + sep.join(heads), sep)


def mathematica(rows: np.ndarray) -> str:
    def number(value: float) -> str:
        return f"{value:.16g}".replace("e", "*^")

    body = ", ".join("{" + ", ".join(map(number, row)) + "}" for row in rows)
    return "{" + body + "}"


def dxf(points: np.ndarray, unit: int) -> str:
    pairs = ["0", "SECTION", "2", "HEADER", "9", "$INSUNITS", "70", str(unit), "0",
             "ENDSEC", "0", "SECTION", "2", "ENTITIES", "0", "LWPOLYLINE", "90",
             str(len(points)), "70", "0"]  # fmt: skip
    for x, y in points:
        pairs += ["10", f"{x:.9g}", "20", f"{y:.9g}"]
    return "\n".join([*pairs, "0", "ENDSEC", "0", "EOF"]) + "\n"


def svg(points: np.ndarray) -> str:
    body = " ".join(f"{x * 2:.6f},{-y * 2:.6f}" for x, y in points)
    return (
        '<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" width="100mm" '
        f'height="50mm" viewBox="0 -50 200 100"><polyline points="{body}"/></svg>'
    )


SHUFFLED = RNG.permutation(len(XY))
TURN = np.array([[math.cos(0.5), math.sin(0.5)], [-math.sin(0.5), math.cos(0.5)]])
EDGE = 0.5 * np.column_stack([-np.sin(LINE.theta_rad), np.cos(LINE.theta_rad)])
SIDES = "".join(
    f"{side},{i},{x:.9g},{y:.9g}\n"
    for side, sign in (("left", 1.0), ("right", -1.0))
    for i, (x, y) in enumerate((XY + sign * EDGE) * np.array([20.0, -20.0]))
)

# name: (file name, content, how, what is said)
RIGHT: dict[str, tuple[str, str, Reading, str]] = {
    "our own": ("s.csv", LINE.to_csv(), Reading(), ""),
    "x_mm, y_mm": ("s.csv", text(XY, "x_mm,y_mm"), Reading(), ""),
    "metres": ("s.csv", text(XY * 1e-3, "x (m),y (m)"), Reading(), ""),
    "micrometres": ("s.csv", text(XY * 1e3, "x_um,y_um"), Reading(), ""),
    "no unit, mm": ("s.csv", text(XY, "x,y"), Reading(), "taken_as_mm"),
    "no unit, said": ("s.csv", text(XY * 1e-3, "x,y"), Reading(unit="m"), ""),
    "no heads": ("s.txt", text(XY, sep=" "), Reading(), "taken_as_mm"),
    "tip first": ("s.csv", text(XY[::-1], "x_mm,y_mm"), Reading(), "reversed"),
    "shuffled": ("s.csv", text(XY[SHUFFLED], "x_mm,y_mm"), Reading(), "reordered"),
    "mirrored": (
        "s.csv", text(XY * [1, -1], "x_mm,y_mm"), Reading(flip=True), "flipped"),
    "moved, turned": (
        "s.csv", text(XY @ TURN + 7.0, "x_mm,y_mm"), Reading(align=True), "aligned"),
    "degrees": (
        "s.csv", text(columns(XY, np.degrees(LINE.theta_rad)), "x_mm,y_mm,theta_deg"),
        Reading(), ""),
    "angle without unit": (
        "s.csv", text(columns(XY, np.degrees(LINE.theta_rad)), "x_mm,y_mm,theta"),
        Reading(), "theta_taken_as_deg"),
    "semicolons": (
        "s.csv", text(XY, "x_mm;y_mm", ";").replace(".", ","), Reading(), ""),
    "digitiser": ("s.csv", text(XY, "x, y"), Reading(unit="mm"), ""),
    "pixels": (
        "s.csv", text(XY * [20, -20], "x_px,y_px"), Reading(mm_per_px=0.05), ""),
    "pixels without a head": (
        "s.txt", text(XY * [20, -20], sep="\t"), Reading(mm_per_px=0.05), ""),
    "imagej results": (
        "s.csv", " ,X,Y\n" + text(columns(np.arange(1, 62), XY * [20, -20])),
        Reading(mm_per_px=0.05), ""),
    "edges in pixels": (
        "s.csv", "side,point,x_px,y_px\n" + SIDES, Reading(mm_per_px=0.05), "edges"),
    "comsol text": ("s.txt", comsol("mm", 1.0), Reading(), ""),
    "comsol metres": ("s.txt", comsol("m", 1e-3), Reading(), ""),
    "comsol shuffled": (
        "s.txt", comsol("m", 1e-3, SHUFFLED), Reading(), "reordered"),
    "comsol csv": ("s.csv", comsol("m", 1e-3, sep=","), Reading(), ""),
    "comsol displacements": (
        "s.txt", COMSOL + text(
            columns(LINE.s_mm, LINE.x_mm - LINE.s_mm, LINE.y_mm) * 1e-3,
            "% X (m)   u (m)   v (m)", "   "), Reading(), ""),
    "mathematica": ("s.m", mathematica(XY), Reading(), "taken_as_mm"),
    "mathematica, named": (
        "s.wl", "pts = " + mathematica(XY) + ";", Reading(), "taken_as_mm"),
    "mathematica, five": (
        "s.txt", mathematica(columns(
            LINE.s_mm, XY, LINE.theta_rad, LINE.kappa_per_mm)), Reading(),
        "theta_taken_as_rad"),
    "dxf in mm": ("s.dxf", dxf(XY, 4), Reading(), ""),
    "dxf in inches": ("s.dxf", dxf(XY / 25.4, 1), Reading(), ""),
    "dxf without unit": ("s.dxf", dxf(XY, 0), Reading(), "taken_as_mm"),
    "svg": ("s.svg", svg(XY), Reading(), ""),
}  # fmt: skip


def close(line: Centreline, other: Centreline = LINE, atol_mm: float = 2e-3) -> None:
    assert line.length_mm == pytest.approx(other.length_mm, abs=atol_mm)
    s = np.linspace(0.0, line.s_mm[-1], 200)
    for name, atol in (("x_mm", atol_mm), ("y_mm", atol_mm), ("theta_rad", 2e-3)):
        mine = np.interp(s, line.s_mm, getattr(line, name))
        truth = np.interp(s, other.s_mm, getattr(other, name))
        np.testing.assert_allclose(mine, truth, atol=atol)


@pytest.mark.parametrize("kind", RIGHT)
def test_a_shape_from_elsewhere_is_read_right(kind: str, tmp_path: Path) -> None:
    name, content, how, note = RIGHT[kind]
    (tmp_path / name).write_text(content)
    (found,) = read_shapes(tmp_path / name, how, length_mm=LENGTH_MM, side=1.0)
    close(found.line)
    assert (note in found.notes) if note else not found.notes


REFUSED: dict[str, tuple[str, str, str]] = {
    "metres without a unit": ("s.csv", text(XY * 1e-3, "x,y"), "add --unit m"),
    "metres headed mm": ("s.csv", text(XY * 1e-3, "x_mm,y_mm"), "add --unit m"),
    "another rod": ("s.csv", text(XY * 1.2, "x_mm,y_mm"), "is 36 mm long.*30 mm"),
    "mirrored": ("s.csv", text(XY * [1, -1], "x_mm,y_mm"), "add --flip"),
    "moved": ("s.csv", text(XY + 7.0, "x_mm,y_mm"), "add --align"),
    "turned": ("s.csv", text(XY @ TURN, "x_mm,y_mm"), "leaves it at .*add --align"),
    "degrees headed rad": (
        "s.csv", text(columns(XY, np.degrees(LINE.theta_rad)), "x_mm,y_mm,theta_rad"),
        "add --angles deg"),
    "theta of the other sign": (
        "s.csv", text(columns(XY, -LINE.theta_rad), "x_mm,y_mm,theta_rad"),
        "other sign"),
    "theta of something else": (
        "s.csv", text(columns(XY, LINE.theta_rad + 0.4), "x_mm,y_mm,theta_rad"),
        "does not agree"),
    "pixels without a scale": (
        "s.csv", text(XY * [20, -20], "x_px,y_px"), "add --mm-per-px"),
    "pixels that say nothing": (
        "s.txt", text(XY * [20, -20], sep="\t"), r"--mm-per-px .* \(about 0.05 would"),
    "an undeformed rod": (
        "s.csv", text(columns(LINE.s_mm, 0.0 * LINE.s_mm), "X,Y"), "columns x and y"),
    "x and y in two units": (
        "s.csv", text(XY, "x_mm,y_m"), "in one unit"),
    "s in another unit": (
        "s.csv", text(columns(LINE.s_mm * 1e-3, XY), "s,x,y"), "arc length"),
    "both commas": ("s.csv", text(XY, "x_mm,y_mm").replace(".", ","), "more values"),
    "a surface": (
        "s.txt", COMSOL + text(
            np.vstack([columns(LINE.s_mm, XY), columns(LINE.s_mm, XY + np.eye(2)[1])]),
            "% X (mm)   x (mm)   y (mm)", "   "), "no line"),
    "comsol by sections": (
        "s.txt", COMSOL + "% Coordinates\n0 0\n% Elements (lines)\n1 2\n% Data\n1\n",
        "Spreadsheet"),
    "not a number": ("s.csv", "x_mm,y_mm\n0,0\n1,zero\n2,0\n", "line 3: y_mm"),
    "two points": ("s.csv", text(XY[:2], "x_mm,y_mm"), "three finite points"),
    "mathematica, symbols": ("s.m", "{{0, 0}, {Pi, 1}, {2, 2}}", "'Pi'"),
    "mathematica, ragged": ("s.m", "{{0, 0}, {1, 1, 1}}", "as many numbers"),
    "mathematica, unclosed": ("s.m", "{{0, 0}, {1, 1}", "one list of points"),
    "mathematica, deep": ("s.m", "{{{{{{0}}}}}}", "nested deeper"),
    "dxf with a spline": (
        "s.dxf", "0\nSECTION\n2\nENTITIES\n0\nSPLINE\n0\nEOF\n", "SPLINE; explode"),
    "dxf with an odd unit": (
        "s.dxf", dxf(2.0 * XY, 4).replace("\n70\n4\n", "\n70\n4%\n"), "60 long"),
    "coordinates out of reach": (
        "s.csv", text(XY * 1e290, "x_mm,y_mm"), "beyond 1e"),
    "svg under a transform": (
        "s.svg", svg(XY).replace("<polyline", '<g transform="scale(2)"><polyline')
        .replace("</svg>", "</g></svg>"), "transform"),
    "svg that grows": (
        "s.svg", '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><svg/>',
        "entities"),
    "a picture": ("s.csv", "\x89PNG", "is a PNG picture"),
    "a broken mat": ("s.mat", "MATLAB 5.0 MAT-file, cut off", "MATLAB"),
    "no workbook": ("s.xlsx", "PK\x03\x04 cut off", "no Excel workbook"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_does_not_fit_is_refused_with_the_change(
    kind: str, tmp_path: Path
) -> None:
    name, content, words = REFUSED[kind]
    (tmp_path / name).write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match=words) as caught:
        read_shapes(tmp_path / name, length_mm=LENGTH_MM, side=1.0)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("sep", ["   ", ","])
def test_a_sweep_side_by_side_is_a_shape_each(sep: str, tmp_path: Path) -> None:
    (tmp_path / "sweep.txt").write_text(comsol_sweep(sep))
    found = read_shapes(tmp_path / "sweep.txt", length_mm=LENGTH_MM, side=1.0)
    assert [each.parameters for each in found] == [
        {"B0": 0.02}, {"B0": 0.05}, {"B0": 0.08}
    ]  # fmt: skip
    for each, flux_mT in zip(found, (20.0, 50.0, 80.0), strict=True):
        close(each.line, shape(flux_mT))
    one = read_shape("sweep.txt @ B0=0.08", tmp_path, length_mm=LENGTH_MM)
    close(one.line, shape(80.0))
    close(read_shape("sweep.txt @ 2", tmp_path, length_mm=LENGTH_MM).line)
    with pytest.raises(InputError, match=r"3 shapes; name one, as in .* @ B0=0.02"):
        read_shape("sweep.txt", tmp_path)
    with pytest.raises(InputError, match="names 0 of 3 shapes"):
        read_shape("sweep.txt @ B0=0.5", tmp_path)


def test_shapes_below_each_other_are_parted_by_their_parameters(
    tmp_path: Path,
) -> None:
    rows = [
        columns(np.full(61, flux_mT), shape(flux_mT).points_mm)
        for flux_mT in (20.0, 50.0)
    ]
    (tmp_path / "s.csv").write_text(text(np.vstack(rows), "flux_mT,x_mm,y_mm"))
    found = read_shapes(tmp_path / "s.csv", length_mm=LENGTH_MM, side=1.0)
    assert [each.parameters for each in found] == [{"flux_mT": 20.0}, {"flux_mT": 50.0}]
    close(found[1].line)


def _mat_vectors(path: Path) -> None:
    savemat(path, {"x_mm": LINE.x_mm, "y_mm": LINE.y_mm, "operator": "me"})


def _mat_struct(path: Path) -> None:
    names = ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm")
    savemat(path, {"line": {name: getattr(LINE, name) for name in names}})


def _mat_matrix(path: Path) -> None:
    savemat(path, {"xy_mm": XY})


def _mat_hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["x_m"], file["y_m"] = LINE.x_mm[None] * 1e-3, LINE.y_mm[None] * 1e-3


def _workbook(path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["notes of the day"])
    sheet = book.create_sheet("shape")
    for row in [("x (mm)", "y (mm)"), *XY.tolist()]:
        sheet.append(list(row))
    book.save(path)


BINARY: dict[str, Callable[[Path], None]] = {
    "v.mat": _mat_vectors, "s.mat": _mat_struct, "m.mat": _mat_matrix,
    "h.mat": _mat_hdf5, "w.xlsx": _workbook,
}  # fmt: skip


@pytest.mark.parametrize("name", BINARY)
def test_matlab_and_excel_are_read_right(name: str, tmp_path: Path) -> None:
    BINARY[name](tmp_path / name)
    (found,) = read_shapes(tmp_path / name, length_mm=LENGTH_MM, side=1.0)
    close(found.line)


def test_a_sweep_in_matrices_is_a_shape_a_column(tmp_path: Path) -> None:
    lines = [shape(flux_mT) for flux_mT in (20.0, 50.0, 80.0)]
    savemat(
        tmp_path / "s.mat",
        {
            "x_mm": columns(*(line.x_mm for line in lines)),
            "y_mm": columns(*(line.y_mm for line in lines)),
            "flux_mT": np.array([20.0, 50.0, 80.0]),
        },
    )
    found = read_shapes(tmp_path / "s.mat", length_mm=LENGTH_MM, side=1.0)
    assert [each.parameters["flux_mT"] for each in found] == [20.0, 50.0, 80.0]
    close(found[2].line, lines[2])


def test_without_a_specimen_the_unit_must_be_said(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text(text(XY, "x,y"))
    with pytest.raises(InputError, match="add --unit mm"):
        read_shapes(tmp_path / "s.csv")
    (found,) = read_shapes(tmp_path / "s.csv", Reading(unit="mm"))
    close(found.line)


def test_what_a_file_brings_is_kept_to_the_last_digit(tmp_path: Path) -> None:
    LINE.to_csv(tmp_path / "s.csv")
    (found,) = read_shapes(tmp_path / "s.csv", length_mm=LENGTH_MM)
    for name in ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm"):
        np.testing.assert_allclose(
            getattr(found.line, name), getattr(LINE, name), rtol=1e-12, atol=1e-12
        )


def test_clicked_points_are_aligned_as_well_as_is_said(tmp_path: Path) -> None:
    """Each 0.3 px off, of 0.05 mm: the ends of a spline then point anywhere."""
    rng = np.random.default_rng(7)
    clicked, at = LINE.s_mm[::2], tmp_path / "s.csv"
    xy = columns(*(np.interp(clicked, LINE.s_mm, c) for c in (LINE.x_mm, LINE.y_mm)))
    turned, told = [], []

    def outer(line: Centreline) -> float:
        half = len(line.s_mm) // 2
        dx, dy = line.x_mm[-1] - line.x_mm[half], line.y_mm[-1] - line.y_mm[half]
        return math.atan2(dy, dx)

    for _ in range(40):
        at.write_text(text((xy + rng.normal(scale=0.015, size=xy.shape)) @ TURN, "x,y"))
        (found,) = read_shapes(
            at, Reading(unit="mm", align=True), length_mm=LENGTH_MM, side=1.0
        )
        turned.append(math.degrees(outer(found.line) - outer(LINE)))
        told.append(found.direction_sd_deg)
    assert 0.7 < np.std(turned) / math.sqrt(np.mean(np.square(told))) < 1.4


def test_a_missing_file_and_a_folder_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_shapes(tmp_path / "none.csv")
    with pytest.raises(ConfigError, match="is a folder, not a file"):
        read_shapes(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_in_place_of_a_shape_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "curve.csv")
    with pytest.raises(ConfigError, match="is a pipe or a device, not a file"):
        read_shapes(tmp_path / "curve.csv")


def test_shapes_side_by_side_are_told_apart_and_none_is_taken_for_another(
    tmp_path: Path,
) -> None:
    """As a digitiser saves its data sets; the last pair was taken without a word."""
    weak = shape(20.0).points_mm
    path = tmp_path / "sets.csv"
    path.write_text("weak,,strong,\n" + text(columns(weak, XY), "X,Y,X,Y"))
    for number, wanted in (("1", weak), ("2", XY)):
        found = read_shape(f"sets.csv @ {number}", tmp_path, length_mm=LENGTH_MM)
        assert found.line.tip_mm == pytest.approx(wanted[-1], abs=1e-3)
    with pytest.raises(InputError, match=r"holds 2 shapes; name one.* @ 1"):
        read_shape("sets.csv", tmp_path, length_mm=LENGTH_MM)
    path.write_text(text(columns(weak, XY[:, 0]), "x_mm,y_mm,x_mm"))
    with pytest.raises(ConfigError, match="x 2 times, y 1 times"):
        read_shape("sets.csv", tmp_path, length_mm=LENGTH_MM)
