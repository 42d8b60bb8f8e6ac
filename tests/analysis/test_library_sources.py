"""Libraries before sources of any kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from magbend.analysis.library.build import build, digest_of, read_manifest
from magbend.analysis.library.query import query
from magbend.analysis.library.space import Space, read_space
from magbend.core.errors import ConfigError
from magbend.sim import Field, Rod, Section, flux_mT, read_field, solve

pytest.importorskip("pyarrow")

RODS = """
name = "rods"
partition_rows = 1024
side_mm = [0.8, 1.1]
remanence_mT = [20.0]
"""
SECTIONS = """
[[section]]
length_mm = [12.0, 18.0]
E_MPa = [9.0]
[[section]]
length_mm = [10.0]
E_MPa = [5.0]
"""
SEVERAL = """
[[source]]
kind = "cuboid"
side_mm = 20.0
remanence_T = 1.3
[[source]]
kind = "cuboid"
sides_mm = [8.0, 8.0, 12.0]
remanence_T = -1.2
centre_mm = [60.0, 30.0, 0.0]
[[source]]
kind = "coil"
diameter_mm = 50.0
current_A = 4.0
turns = 100
centre_mm = [-40.0, 0.0, 0.0]
axis_angle_deg = 0.0
"""
CYLINDER = """
[[source]]
kind = "cylinder"
diameter_mm = 40.0
length_mm = 30.0
remanence_T = 1.3
centre_mm = [25.0, -70.0, 0.0]
"""


def space_of(folder: Path, sources: str, gaps: str = "") -> Path:
    path = folder / "space.toml"
    path.write_text(RODS + gaps + SECTIONS + sources)
    return path


def write_map(folder: Path) -> str:
    """Write the readings of the cylinder over where the rods go."""
    cylinder = folder / "cylinder.toml"
    cylinder.write_text(CYLINDER)
    x, y = np.meshgrid(np.linspace(-5.0, 35.0, 21), np.linspace(-12.0, 28.0, 21))
    points = np.column_stack([x.ravel(), y.ravel(), 0.0 * x.ravel()])
    flux = flux_mT(read_field(cylinder), points, length_mm=30.0)
    head = "x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT"
    np.savetxt(folder / "map.csv", np.hstack([points, flux]), delimiter=",",
               header=head, comments="", fmt="%.9g")  # fmt: skip
    return '[[source]]\nkind = "map"\nfile = "map.csv"\n'


def shape_of(row: dict, field: Field) -> tuple[float, float]:
    rod = Rod(
        name="row", side_mm=row["side_mm"], remanence_mT=row["remanence_mT"],
        sections=tuple(
            Section(length_mm=row[f"length{i}_mm"], E_MPa=row[f"E{i}_MPa"])
            for i in (1, 2)
        ),
    )  # fmt: skip
    return solve(rod, field).centreline.tip_mm


@pytest.mark.parametrize("kind", ["several", "placed", "map"])
def test_rows_are_solved_before_the_sources_of_the_space(
    tmp_path: Path, kind: str
) -> None:
    tables = {"several": SEVERAL, "placed": CYLINDER}
    text = write_map(tmp_path) if kind == "map" else tables[kind]
    gaps = "gap_mm = [45.0, 70.0]\n" if kind == "several" else ""
    space = read_space(space_of(tmp_path, text, gaps))
    build(space, tmp_path / "library")
    rows = query(tmp_path / "library", top=100).table.to_pylist()
    assert len(rows) == space.size == (8 if gaps else 4)
    source_file = tmp_path / "sources.toml"
    source_file.write_text(text)
    field = read_field(source_file)
    for row in rows:
        assert row["status"] == "stable"
        here = field.at_gap(row["gap_mm"]) if gaps else field
        tip = shape_of(row, here)
        assert (row["tip_x_mm"], row["tip_y_mm"]) == pytest.approx(tip, abs=1e-4)


def test_a_library_keeps_the_readings_of_its_map(tmp_path: Path) -> None:
    space = read_space(space_of(tmp_path, write_map(tmp_path)))
    build(space, tmp_path / "library")
    (tmp_path / "map.csv").unlink()
    kept = Space.model_validate(read_manifest(tmp_path / "library")["space"])
    assert digest_of(kept) == digest_of(space)
    place = np.array([[20.0, 3.0, 0.0]])
    once, again = (flux_mT(one.sources, place, length_mm=30.0) for one in (space, kept))
    assert again == pytest.approx(once, abs=1e-12)


@pytest.mark.parametrize(
    ("sources", "gaps", "said"),
    [
        (SEVERAL, "", "gap_mm belongs to sources that have neither"),
        (CYLINDER, "gap_mm = [50.0]\n", "gap_mm belongs to sources that have neither"),
        (CYLINDER, "flux_mT = [50.0]\n", "give one of flux_mT"),
        (CYLINDER.replace("0.0]", "9.0]"), "", "within their plane"),
        (CYLINDER.replace("cylinder", "cylindre"), "", "cylindre"),
        (CYLINDER + "colour = 3\n", "", "source 0 .cylinder.: unknown key 'colour'"),
    ],
)
def test_sources_that_do_not_fit_a_space_are_named(
    tmp_path: Path, sources: str, gaps: str, said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        read_space(space_of(tmp_path, sources, gaps))
