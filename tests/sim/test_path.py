"""Paths: folds where theory has them, snaps, hysteresis, and the way back."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.cli import sim as cli
from magbend.core.errors import InputError
from magbend.core.units import MU0
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Dipole,
    Field,
    PathPoint,
    Rod,
    Section,
    Support,
    Uniform,
    UniformField,
    follow_path,
    gmc,
    solve,
)
from magbend.sim.path import walk
from magbend.sim.path.draw import animate_path, draw_path, path_csv
from magbend.sim.path.energy import energy_uJ
from magbend.sim.planar.near import settle
from magbend.sim.study.outlines import outlines_mm

BAR = Rod(
    name="bar", side_mm=1.0, remanence_mT=20.0,
    sections=(Section(length_mm=30.0, E_MPa=5.0),),
)  # fmt: skip
CUBE = Cuboid(sides_mm=55.0, remanence_T=1.305)


def flux_mT_of(beta: float) -> float:
    """Return the flux density at which m B L^2 / EI is beta for the bar."""
    EI_Nm2 = 5e6 * 1e-12 / 12.0
    return beta * EI_Nm2 * MU0 / (20e-3 * 1e-6 * 30e-3**2) * 1e3


# Loads at which the mirrored equilibrium of a uniform rod begins (elliptic integrals).
FOLDS = {150.0: 4.84858825461145, 120.0: 7.16202930751652}


@pytest.mark.parametrize("angle_deg", FOLDS)
def test_a_turning_field_snaps_the_rod_at_the_fold_of_theory(angle_deg: float) -> None:
    field = UniformField(flux_mT=flux_mT_of(FOLDS[angle_deg]), angle_deg=100.0)
    mirrored = 360.0 - angle_deg
    path = follow_path(BAR, field, angle_deg=(100.0, 290.0, 70.0, 100.0), steps=40)
    there, back = path.folds
    assert there.value == pytest.approx(mirrored, abs=1e-4)
    assert back.value == pytest.approx(angle_deg, abs=1e-4)
    assert (there.direction, back.direction) == ("rising", "falling")
    assert there.tip_mm[1] == pytest.approx(-back.tip_mm[1], rel=1e-4)
    assert path.dissipated_uJ > 0.0
    # Having come back, the rod is where it was.
    assert path.points[-1].centreline.tip_mm == pytest.approx(
        path.points[0].centreline.tip_mm, abs=1e-9
    )
    assert sum(point.snapped for point in path.points) == 2


def test_without_fold_each_point_is_that_of_solve_there_and_back() -> None:
    path = follow_path(gmc(2), CUBE, gap_mm=(120.0, 50.0, 120.0), steps=5)
    assert path.folds == ()
    assert path.dissipated_uJ == 0.0
    for point in path.points:
        field = Cuboid(sides_mm=55.0, remanence_T=1.305, gap_mm=point.value)
        np.testing.assert_allclose(
            point.centreline.tip_mm, solve(gmc(2), field).centreline.tip_mm, atol=1e-9
        )


def test_a_rod_of_many_boundary_layers_is_followed_in_few_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rod = Rod(
        name="wavy", shape="round", diameter_mm=0.8, remanence_mT=60.0,
        sections=(
            Section(length_mm=12.0, E_MPa=4.0),
            Section(length_mm=10.0, E_MPa=2.0, remanence_mT=-30.0),
            Section(length_mm=15.0, E_MPa=1.5),
        ),
    )  # fmt: skip
    field = Field(
        Cylinder(
            diameter_mm=40.0, length_mm=30.0, remanence_T=1.3, axis_angle_deg=30.0,
            gap_mm=40.0,
        ),
        Coil(diameter_mm=80.0, current_A=5.0, turns=200, centre_mm=(0.0, -40.0, 0.0)),
        Uniform(flux_mT=-2.0),
        Dipole(moment_A_m2=3.0, centre_mm=(60.0, 50.0, 0.0), axis_angle_deg=200.0),
    )  # fmt: skip
    settled = []

    def counted(*case: object) -> int:
        settled.append(case)
        return settle(*case)

    monkeypatch.setattr(walk, "settle", counted)
    path = follow_path(rod, field, offset_x_mm=(75.0, 70.0), steps=5)
    assert not path.folds
    assert len(settled) < 2_000  # 15 000 where Newton begins from where the rod was
    placed = replace(field.sources[0], offset_mm=(70.0, 0.0, 0.0))
    alone = solve(rod, Field(placed, *field.sources[1:]))
    assert path.points[-1].centreline.tip_mm == pytest.approx(
        alone.centreline.tip_mm, abs=1e-6
    )


def test_the_work_of_a_loop_is_the_torque_on_what_turns_it_and_is_dissipated() -> None:
    """The torque of the field, shape by shape, integrated over its angle."""
    flux = flux_mT_of(FOLDS[120.0])
    start = UniformField(flux_mT=flux, angle_deg=100.0)
    way = (100.0, 290.0, 70.0, 100.0)
    path = follow_path(BAR, start, angle_deg=way, steps=240, points=121)

    def torque(point: PathPoint) -> float:
        near = [
            UniformField(flux_mT=flux, angle_deg=point.value + d) for d in (-0.01, 0.01)
        ]
        low, high = (energy_uJ(BAR, f, Support(), point.centreline) for f in near)
        return (high - low) / 0.02

    work_uJ = sum(
        0.5 * (torque(a) + torque(b)) * (b.value - a.value)
        for a, b in pairwise(path.points)
        if not b.snapped
    )
    missed = sum(  # what the two steps with a snap turn the field by, on either shape
        torque(a) * (fold.value - a.value) + torque(b) * (b.value - fold.value)
        for (a, b), fold in zip(
            [pair for pair in pairwise(path.points) if pair[1].snapped],
            path.folds,
            strict=True,
        )
    )
    assert path.dissipated_uJ > 0.0
    assert path.points[-1].work_uJ == pytest.approx(path.dissipated_uJ, rel=1e-6)
    assert work_uJ + missed == pytest.approx(path.points[-1].work_uJ, rel=0.01)


def test_the_slope_of_the_energy_is_the_work_of_the_magnet() -> None:
    """By the envelope theorem dE/dgap is that of the magnetic energy alone."""
    path = follow_path(gmc(2), CUBE, gap_mm=(60.2, 59.8), steps=2, points=241)
    before, middle, after = path.points
    slope = (after.energy_uJ - before.energy_uJ) / -0.4
    from magbend.sim import Field, flux_mT

    line = middle.centreline
    at = [
        flux_mT(
            Field(CUBE).at_gap(g),
            np.column_stack([line.x_mm, line.y_mm, 0.0 * line.x_mm]),
            length_mm=30.0,
        )
        for g in (60.2, 59.8)
    ]
    change = (at[1] - at[0]) / -0.4
    along = (
        np.cos(line.theta_rad) * change[:, 0] + np.sin(line.theta_rad) * change[:, 1]
    )
    m = gmc(2).side_mm ** 2 * gmc(2).remanence_mT
    work = -m * np.trapezoid(along, line.s_mm) * 1e-15 / MU0 * 1e6
    assert slope == pytest.approx(work, rel=2e-3)


def test_a_magnet_pulls_in_and_lets_go_at_its_contact() -> None:
    rod = Rod(
        name="attracted", side_mm=0.8, remanence_mT=-110.0,
        sections=(Section(length_mm=55.0, E_MPa=12.0),),
    )  # fmt: skip
    path = follow_path(rod, CUBE, gap_mm=(60.0, 40.0, 60.0), steps=20)
    (fold,) = path.folds
    assert fold.direction == "falling"
    assert 43.0 < fold.value < 44.0
    assert math.hypot(*fold.turning) == pytest.approx(1.0)
    lost = [point.value for point in path.points if point.centreline is None]
    assert max(lost) < fold.value
    assert path.points[-1].status == "stable"


def test_other_quantities_change_what_they_name() -> None:
    turned = follow_path(
        gmc(2), Cuboid(sides_mm=55.0, remanence_T=1.3, gap_mm=60.0),
        axis_angle_deg=(90.0, 80.0), steps=2,
    )  # fmt: skip
    other = Cuboid(sides_mm=55.0, remanence_T=1.3, gap_mm=60.0, axis_angle_deg=80.0)
    np.testing.assert_allclose(
        turned.points[-1].centreline.tip_mm, solve(gmc(2), other).centreline.tip_mm
    )
    longer = follow_path(
        gmc(2), UniformField(flux_mT=50.0), insertion_mm=(10.0, 15.0), steps=2
    )
    assert longer.points[-1].centreline.length_mm == pytest.approx(35.0)
    held = follow_path(
        gmc(2), UniformField(flux_mT=50.0), clamp_angle_deg=(0.0, 5.0), steps=2
    )
    same = solve(
        gmc(2), UniformField(flux_mT=50.0), support=Support(clamp_angle_deg=5.0)
    )
    np.testing.assert_allclose(
        held.points[-1].centreline.tip_mm, same.centreline.tip_mm
    )


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (lambda: follow_path(gmc(2), CUBE), "waypoints of one of gap_mm"),
        (lambda: follow_path(gmc(2), CUBE, gap_mm=(60.0,)), "at least two waypoints"),
        (lambda: follow_path(gmc(2), CUBE, gap_mm=(60.0, math.nan)), "finite"),
        (lambda: follow_path(gmc(2), CUBE, gap_mm=(60.0, 60.0)), "must change along"),
        (lambda: follow_path(gmc(2), CUBE, gap_mm=(60.0, -5.0)), "received -5.0"),
        (lambda: follow_path(gmc(2), CUBE, insertion_mm=(5.0, 0.0)), "insertion_mm"),
        (lambda: follow_path(gmc(2), CUBE, flux_mT=(1.0, 2.0)), "flux_mT must belong"),
        (lambda: follow_path(gmc(2), CUBE, speed=(1.0, 2.0)), "instead received speed"),
        (
            lambda: follow_path(gmc(2), Uniform(flux_mT=9.0), gap_mm=(9.0, 8.0)),
            "gap_mm",
        ),
        (
            lambda: follow_path(
                gmc(2), Uniform(flux_mT=9.0, elevation_deg=5.0), flux_mT=(9.0, 8.0)
            ),
            "planar",
        ),
    ],
)
def test_bad_paths_are_refused_in_one_sentence(task: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        task()


def test_what_is_given_as_one_number_is_kept() -> None:
    path = follow_path(
        gmc(2), CUBE, gap_mm=(70.0, 60.0), clamp_angle_deg=5.0, offset_x_mm=3.0, steps=1
    )
    placed = replace(CUBE, gap_mm=60.0, offset_mm=(3.0, 0.0, 0.0))
    alone = solve(gmc(2), placed, support=Support(clamp_angle_deg=5.0))
    assert path.points[-1].centreline.tip_mm == pytest.approx(
        alone.centreline.tip_mm, abs=1e-9
    )


def test_mirrored_shapes_that_leave_a_straight_rod_are_a_bifurcation() -> None:
    """Euler's load of a rod whose field points against it is pi^2 / 4 for m B L^2."""
    euler_mT = flux_mT_of(math.pi**2 / 4.0)
    there, back = follow_path(
        BAR, UniformField(flux_mT=1.0, angle_deg=180.0),
        flux_mT=(0.5 * euler_mT, 1.5 * euler_mT, 0.5 * euler_mT), steps=7,
    ).folds  # fmt: skip
    for one, direction in ((there, "rising"), (back, "falling")):
        assert (one.kind, one.direction) == ("bifurcation", direction)
        assert one.value == pytest.approx(euler_mT, rel=1e-6)
        assert one.turning == pytest.approx((0.0, 1.0), abs=1e-12)
        left, right = one.branches_mm
        assert left == pytest.approx((right[0], -right[1]), abs=1e-9)
        assert abs(left[1]) > 1.0


@pytest.mark.parametrize("last_mm", [10.0, 11.0, 12.5, 14.0])
def test_a_magnet_ahead_of_the_rod_is_no_fold(last_mm: float) -> None:
    ahead = replace(CUBE, axis_angle_deg=180.0)
    path = follow_path(gmc(2), ahead, gap_mm=(120.0, last_mm, 120.0), steps=30)
    assert [one.kind for one in path.folds] == ["bifurcation"] * 2
    there, back = path.folds
    assert there.value == pytest.approx(back.value, abs=1e-3)
    for gap_mm, index in ((there.value + 0.01, 0), (there.value - 0.01, 1)):
        alone = solve(gmc(2), Field(ahead).at_gap(gap_mm))
        assert alone.morse_index == index
    (x, y), other = alone.buckled_tips_mm
    assert other == pytest.approx((x, -y), abs=1e-9)
    for one in (there, back):
        assert len(one.branches_mm) == 2


def test_outlines_are_where_the_bodies_are() -> None:
    field = Field(
        Cuboid(sides_mm=(20.0, 30.0, 10.0), remanence_T=1.3, gap_mm=50.0),
        Coil(diameter_mm=40.0, current_A=1.0, wire_mm=2.0, centre_mm=(90.0, 0.0, 0.0),
             axis_angle_deg=0.0),
        Uniform(flux_mT=3.0),
    )  # fmt: skip
    magnet, left, right = outlines_mm(field, 30.0)
    assert np.ptp(magnet, axis=0) == pytest.approx([20.0, 10.0])
    assert magnet.max(axis=0) == pytest.approx([40.0, -50.0])
    assert sorted([left.mean(axis=0)[1], right.mean(axis=0)[1]]) == [-20.0, 20.0]
    assert left.mean(axis=0)[0] == pytest.approx(90.0)


def test_tables_figures_and_animations(tmp_path: Path) -> None:
    path = follow_path(gmc(2), CUBE, gap_mm=(80.0, 60.0), steps=3)
    rows = path_csv(path).splitlines()
    assert rows[0].startswith("gap_mm,status,")
    assert len(rows) == 5
    draw_path(tmp_path / "path.svg", path, title="rod")
    assert (tmp_path / "path.svg").read_text().startswith("<?xml")
    animate_path(tmp_path / "path.gif", path, title="rod")
    from PIL import Image

    with Image.open(tmp_path / "path.gif") as film:
        assert film.n_frames == 4
    with pytest.raises(InputError, match=r"[.]gif"):
        animate_path(tmp_path / "path.mp3", path, title="rod")


def test_the_command_says_points_and_folds(tmp_path: Path) -> None:
    rod, magnet = tmp_path / "S.toml", tmp_path / "M.toml"
    rod.write_text(
        'name = "attracted"\nside_mm = 0.8\nremanence_mT = -110\n'
        "[[section]]\nlength_mm = 55\nE_MPa = 12\n"
    )
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    options = ["path", "--specimen", str(rod), "--magnet", str(magnet)]
    done = CliRunner().invoke(
        cli.app, [*options, "--gap-mm", "120:30:120", "--steps", "9", "--json"]
    )
    found = json.loads(done.output)
    assert [point["gap_mm"] for point in found["points"]][:2] == [120.0, 110.0]
    assert found["points"][-1]["tip_mm"] == pytest.approx(found["points"][0]["tip_mm"])
    assert {point["status"] for point in found["points"]} == {
        "stable", "pulled in: no equilibrium",
    }  # fmt: skip
    assert found["folds"][0]["direction"] == "falling"
    assert CliRunner().invoke(cli.app, options).exit_code == 2
    idle = [*options, "--gap-mm", "60:50", "--angle-deg", "10"]
    assert CliRunner().invoke(cli.app, idle).exit_code == 2
    twice = [*options, "--gap-mm", "120:30:120", "--field-mT", "10:20"]
    said = " ".join(CliRunner().invoke(cli.app, twice).output.replace("│", "").split())
    assert "--gap-mm 120:30:120 and --field-mT 10:20 were given" in said
