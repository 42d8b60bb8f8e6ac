"""Sources of fields: against magpylib, against Maxwell, and in every solver."""

from __future__ import annotations

import math
from pathlib import Path

import magpylib
import numpy as np
import pytest

from magbend.core.errors import ConfigError, InputError
from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Dipole,
    Field,
    FieldMap,
    Gradient,
    MagnetField,
    Support,
    Uniform,
    UniformField,
    find_equilibria,
    flux_mT,
    gmc,
    read_field,
    sampled_map,
    sensitivities,
    solve,
    solve_many,
    solve_spatial,
    verify,
)
from magbend.sim.magnet.map import read_map
from magbend.sim.probe import field_table

POSE = {"axis_angle_deg": 70.0, "elevation_deg": 25.0, "centre_mm": (5.0, -80.0, 9.0)}
BODIES = {
    "cuboid": Cuboid(sides_mm=(30.0, 40.0, 50.0), remanence_T=1.2, **POSE),
    "cylinder": Cylinder(diameter_mm=40.0, length_mm=25.0, remanence_T=-1.3, **POSE),
    "sphere": Dipole(diameter_mm=30.0, remanence_T=1.1, **POSE),
    "dipole": Dipole(moment_A_m2=20.0, **POSE),
    "ring": Coil(diameter_mm=60.0, current_A=100.0, turns=40, **POSE),
    "layer": Coil(diameter_mm=60.0, current_A=9.0, turns=400, length_mm=30.0, **POSE),
}
SMOOTH = {
    "uniform": Uniform(flux_mT=12.0, angle_deg=33.0, elevation_deg=20.0),
    "gradient": Gradient(
        gradient_mT_per_mm=((0.2, 0.1, -0.3), (0.1, -0.5, 0.05), (-0.3, 0.05, 0.3)),
        centre_mm=(10.0, 4.0, -3.0),
    ),
}
ALL = BODIES | SMOOTH


def oracle_mT(name: str, points_mm: np.ndarray) -> np.ndarray:
    """Return what magpylib makes of a body; its mu0 is not 4 pi 1e-7 exactly."""
    source = BODIES[name]
    kinds = {
        "cuboid": lambda: magpylib.magnet.Cuboid(
            dimension=[s * 1e-3 for s in source.sides_mm],
            polarization=(0, 0, source.remanence_T),
        ),
        "cylinder": lambda: magpylib.magnet.Cylinder(
            dimension=(source.diameter_mm * 1e-3, source.length_mm * 1e-3),
            polarization=(0, 0, source.remanence_T),
        ),
        "sphere": lambda: magpylib.magnet.Sphere(
            diameter=source.diameter_mm * 1e-3, polarization=(0, 0, source.remanence_T)
        ),
        "dipole": lambda: magpylib.misc.Dipole(
            moment=(0, 0, source.moment_A_m2 * MU0 / magpylib.mu_0)
        ),
        "ring": lambda: magpylib.current.Circle(
            diameter=source.diameter_mm * 1e-3,
            current=source.current_A * source.turns * MU0 / magpylib.mu_0,
        ),
        # A layer of current is a cylinder with B_r = mu0 N I / l.
        "layer": lambda: magpylib.magnet.Cylinder(
            dimension=(source.diameter_mm * 1e-3, source.length_mm * 1e-3),
            polarization=(0, 0, MU0 * source.current_A * source.turns / 0.03),
        ),
    }
    axes = np.array(source.axes())
    own = (points_mm - np.array(source.centre_mm)) @ axes.T
    return kinds[name]().getB(own * 1e-3) @ axes * 1e3


def around(source: object, rng: np.random.Generator, n: int = 400) -> np.ndarray:
    """Return points outside a body, from near its faces to ten sizes away."""
    axes, centre = np.array(source.axes()), np.array(source.centre_mm)
    out = rng.normal(size=(n, 3))
    out *= (
        55.0
        * 10.0 ** rng.uniform(0.0, 1.0, (n, 1))
        / np.linalg.norm(out, axis=1, keepdims=True)
    )
    out[:20, 2] += np.where(out[:20, 2] < 0.0, -40.0, 40.0)
    out[:20, :2] *= 1e-7  # next to the axis
    return centre + out @ axes


@pytest.mark.parametrize("name", BODIES)
def test_fluxes_agree_with_magpylib(name: str) -> None:
    points = around(BODIES[name], np.random.default_rng(1))
    mine = flux_mT(Field(BODIES[name], SMOOTH["uniform"]), points, length_mm=30.0)
    mine -= flux_mT(Field(SMOOTH["uniform"]), points, length_mm=30.0)
    alone = flux_mT(BODIES[name], points, length_mm=30.0)
    theirs = oracle_mT(name, points)
    size = np.linalg.norm(theirs, axis=1)
    assert np.max(np.linalg.norm(alone - theirs, axis=1) / size) < 1e-10
    np.testing.assert_allclose(mine, alone, atol=1e-11)


@pytest.mark.parametrize("sizes", [5.0, 20.0, 100.0])
def test_far_from_a_cuboid_no_digit_is_lost(sizes: float) -> None:
    """By quadrature of its dipoles: a closed form cancels there, magpylib's to 4e-9."""
    source = BODIES["cuboid"]
    axes, half = np.array(source.axes()), np.array(source.sides_mm) / 2.0
    nodes, weights = np.polynomial.legendre.leggauss(12)
    inside = np.stack(np.meshgrid(*(half[:, None] * nodes), indexing="ij"), axis=-1)
    weight = np.einsum("i,j,k->ijk", weights, weights, weights) * half.prod()
    rng = np.random.default_rng(4)
    for _ in range(8):
        away = rng.normal(size=3)
        away *= 55.0 * sizes / np.linalg.norm(away)
        r = axes @ away - inside
        size = np.linalg.norm(r, axis=-1, keepdims=True)
        dipoles = (3.0 * r[..., 2:] * r / size**2 - [0.0, 0.0, 1.0]) / size**3
        total = np.einsum("ijk,ijkl->l", weight, dipoles) @ axes
        true_mT = total * source.remanence_T / (4.0 * math.pi) * 1e3
        found = flux_mT(source, np.array(source.centre_mm) + away, length_mm=30.0)
        np.testing.assert_allclose(found, true_mT, atol=1e-14 * np.linalg.norm(true_mT))


@pytest.mark.parametrize("name", ALL)
def test_gradients_are_those_of_the_flux_without_curl_and_divergence(name: str) -> None:
    rng = np.random.default_rng(2)
    points = around(BODIES.get(name, BODIES["cuboid"]), rng, 60)
    field = Field(ALL[name], Uniform(flux_mT=1.0))
    table = field_table(field, points, length_mm=30.0)
    G = table[:, 3:].reshape(-1, 3, 3)
    size = np.linalg.norm(G, axis=(1, 2)) + 1e-300
    assert np.max(np.abs(np.trace(G, axis1=1, axis2=2)) / size) < 1e-10
    assert np.max(np.abs(G - G.transpose(0, 2, 1)).max(axis=(1, 2)) / size) < 1e-10
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-3
        up = flux_mT(field, points + step, length_mm=30.0)
        down = flux_mT(field, points - step, length_mm=30.0)
        slope = (up - down) / 2e-3 * 1e-3
        scale = size + 1e-9 * np.linalg.norm(table[:, :3], axis=1)
        assert np.max(np.linalg.norm(slope - G[:, :, k], axis=1) / scale) < 1e-5


PLANAR = {
    "two cuboids": Field(
        Cuboid(sides_mm=30.0, remanence_T=1.3, gap_mm=60.0),
        Cuboid(sides_mm=30.0, remanence_T=-1.2, axis_angle_deg=200.0, gap_mm=50.0),
    ),
    "cylinder": Field(
        Cylinder(diameter_mm=40.0, length_mm=30.0, remanence_T=1.3, gap_mm=50.0)
    ),
    "sphere and uniform": Field(
        Dipole(diameter_mm=40.0, remanence_T=1.3, gap_mm=40.0, axis_angle_deg=60.0),
        Uniform(flux_mT=10.0, angle_deg=200.0),
    ),
    "coil and gradient": Field(
        Coil(diameter_mm=80.0, current_A=100.0, turns=200, gap_mm=40.0),
        Gradient(gradient_mT_per_mm=((0.2, 0.1, 0), (0.1, -0.5, 0), (0, 0, 0.3))),
    ),
}


@pytest.mark.parametrize("name", PLANAR)
def test_every_solver_takes_any_source(name: str) -> None:
    field = PLANAR[name]
    one = solve(gmc(2), field)
    assert one.status == "stable"
    assert verify(gmc(2), field, one) < 1e-7
    space = solve_spatial(gmc(2), field)
    np.testing.assert_allclose(space.r_mm[-1, :2], one.centreline.tip_mm, atol=1e-5)
    solid = solve(gmc(2), field, model="solid")
    plain, stiff = one.centreline.tip_mm[1], solid.centreline.tip_mm[1]
    assert 0.98 * abs(plain) < abs(stiff) < 1.02 * abs(plain)


def test_one_cuboid_is_the_magnet_of_today() -> None:
    magnet = Magnet.cube(55.0, 1.305, offset_mm=(1.0, 2.0, 0.0))
    old = solve(gmc(2), MagnetField(magnet=magnet, gap_mm=60.0))
    new = solve(
        gmc(2),
        Cuboid(
            sides_mm=55.0, remanence_T=1.305, offset_mm=(1.0, 2.0, 0.0), gap_mm=60.0
        ),
    )
    assert new.centreline.tip_mm == old.centreline.tip_mm
    split = [
        Cuboid(
            sides_mm=(55.0, 55.0, 27.5), remanence_T=1.305, gap_mm=60.0 + 27.5 * k,
            offset_mm=(1.0, 2.0, 0.0),
        )
        for k in range(2)
    ]  # fmt: skip
    two = solve(gmc(2), Field(split))
    np.testing.assert_allclose(two.centreline.tip_mm, old.centreline.tip_mm, atol=1e-11)


def test_uniform_fields_add_up_to_one() -> None:
    field = Field(
        Uniform(flux_mT=30.0, angle_deg=90.0), Uniform(flux_mT=40.0, angle_deg=0.0)
    )
    along = math.degrees(math.atan2(3.0, 4.0))
    same = UniformField(flux_mT=50.0, angle_deg=along)
    np.testing.assert_allclose(
        solve(gmc(2), field).centreline.tip_mm, solve(gmc(2), same).centreline.tip_mm,
        atol=1e-12,
    )  # fmt: skip
    assert len(find_equilibria(gmc(2), field)) == len(find_equilibria(gmc(2), same))


def test_a_gradient_alone_pulls_an_on_axis_rod_nowhere() -> None:
    pull = Gradient(gradient_mT_per_mm=((1.0, 0, 0), (0, -0.5, 0), (0, 0, -0.5)))
    assert abs(solve(gmc(2), pull).centreline.tip_mm[1]) < 1e-12


NUMBERS = {
    "two cuboids": [
        "gap_mm", "source[0].gap_mm", "source[1].axis_angle_deg", "length_mm[1]",
        "source[0].remanence_T", "source[1].offset_mm[0]", "E_MPa[2]",
    ],
    "sphere and uniform": [
        "source[0].gap_mm", "source[0].remanence_T", "source[1].flux_mT",
        "source[1].angle_deg", "source[0].axis_angle_deg",
    ],
    "coil and gradient": ["source[0].current_A", "gap_mm", "length_mm[0]"],
}  # fmt: skip


@pytest.mark.parametrize("name", NUMBERS)
def test_sensitivities_of_sources_are_exact(name: str) -> None:
    from dataclasses import replace

    field = PLANAR[name]
    found = sensitivities(gmc(2), field, parameters=NUMBERS[name])
    for k, parameter in enumerate(NUMBERS[name]):
        ends = []
        for sign in (1.0, -1.0):
            step = sign * 1e-4
            rod, sources = gmc(2), list(field.sources)
            key = parameter.split(".")[-1]
            if parameter.startswith(("length_mm", "E_MPa")):
                base, i = key[:-3], int(key[-2])
                parts = list(rod.sections)
                parts[i] = replace(parts[i], **{base: getattr(parts[i], base) + step})
                rod = replace(rod, sections=tuple(parts))
            elif parameter == "gap_mm":
                sources = [
                    replace(s, gap_mm=s.gap_mm + step) if hasattr(s, "gap_mm") else s
                    for s in sources
                ]
            else:
                i = int(parameter[7])
                if key == "offset_mm[0]":
                    sources[i] = replace(sources[i], offset_mm=(step, 0.0, 0.0))
                else:
                    value = getattr(sources[i], key) + step
                    sources[i] = replace(sources[i], **{key: value})
            line = solve(rod, Field(sources), points=61).centreline
            s = np.linspace(0.0, gmc(2).length_mm, 61)
            ends.append(np.interp(s, line.s_mm, line.theta_rad))
        slope = (ends[0] - ends[1]) / 2e-4
        away = np.arange(61) % 20 != 0  # from joints, where curvature jumps
        np.testing.assert_allclose(
            found.dtheta_rad[away, k],
            slope[away],
            atol=2e-4 * np.abs(slope).max() + 1e-9,
        )


def test_batches_stand_before_any_source() -> None:
    waiting = Field(
        Cylinder(diameter_mm=40.0, length_mm=30.0, remanence_T=1.3),
        Uniform(flux_mT=5.0, angle_deg=180.0),
    )
    gaps = [40.0, 60.0, 90.0]
    tips = solve_many(
        {"length_mm": [10.0, 10.0, 10.0], "E_MPa": [20.0, 15.0, 10.0], "side_mm": 1.0,
         "remanence_mT": 20.07, "gap_mm": gaps},
        magnet=waiting,
    )  # fmt: skip
    for row, gap_mm in zip(tips, gaps, strict=True):
        x, y = solve(gmc(2), waiting.at_gap(gap_mm)).centreline.tip_mm
        off = math.hypot(row["tip_x_mm"] - x, row["tip_y_mm"] - y)
        assert off <= row["error_mm"] + 1e-12 < 1e-4


BOX = np.array([[-2.0, -12.0, -12.0], [34.0, 12.0, 12.0]])


def test_a_map_of_a_magnet_bends_as_the_magnet() -> None:
    magnet = Cuboid(sides_mm=55.0, remanence_T=1.305, gap_mm=60.0)
    edges = [np.arange(a, b + 1.0, 4.0) for a, b in BOX.T]
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    noise = np.random.default_rng(5).normal(scale=0.02, size=grid.shape)
    readings = flux_mT(magnet, grid, length_mm=30.0) + noise
    field = FieldMap(points_mm=grid, flux_mT=readings, tolerance_mT=0.05)
    assert 0.01 < field.residual_mT < 0.03
    true = solve(gmc(2), magnet).centreline.tip_mm
    found = solve(gmc(2), field).centreline.tip_mm
    assert math.dist(true, found) < 2e-3
    table = field_table(Field(field), [[14.0, 3.0, 2.0]], length_mm=30.0)[0]
    G = table[3:].reshape(3, 3)
    assert abs(np.trace(G)) < 1e-15
    assert np.abs(G - G.T).max() < 1e-15


def test_a_flat_map_keeps_the_plane() -> None:
    magnet = Cuboid(sides_mm=55.0, remanence_T=1.305, gap_mm=60.0)
    x, y = np.meshgrid(np.arange(-2.0, 35.0, 2.0), np.arange(-10.0, 11.0, 2.0))
    grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    readings = flux_mT(magnet, grid, length_mm=30.0)
    readings[:, 2] = np.random.default_rng(6).normal(scale=0.05, size=len(grid))
    field = Field(FieldMap(points_mm=grid, flux_mT=readings))
    assert field.in_plane
    true = solve(gmc(2), magnet).centreline.tip_mm
    assert math.dist(true, solve(gmc(2), field).centreline.tip_mm) < 1e-3
    sensitivities(gmc(2), field, parameters=["E_MPa[0]"])
    with pytest.raises(InputError, match=r"Bz_mT .* instead received 3.* mT \(RMS\)"):
        FieldMap(points_mm=grid, flux_mT=readings + np.eye(3)[2] * 3.0)


def test_a_reading_of_the_wrong_sign_is_pointed_at() -> None:
    magnet = Cuboid(sides_mm=55.0, remanence_T=1.305, gap_mm=60.0)
    edges = [np.arange(a, b + 1.0, 6.0) for a, b in BOX.T]
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    readings = flux_mT(magnet, grid, length_mm=30.0)
    at = int(np.flatnonzero(np.all(grid == [10.0, 0.0, 0.0], axis=1))[0])
    readings[at] *= -1.0
    with pytest.raises(InputError, match=r"most at \(10.0, 0.0, 0.0\) mm"):
        FieldMap(points_mm=grid, flux_mT=readings)


def test_a_map_whose_lengths_are_headed_in_another_unit_is_refused(
    tmp_path: Path,
) -> None:
    magnet = Cuboid(sides_mm=55.0, remanence_T=1.305, gap_mm=60.0)
    edges = [np.arange(a, b + 1.0, 6.0) for a, b in BOX.T]
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    rows = np.hstack([grid, flux_mT(magnet, grid, length_mm=30.0)])

    def written(unit: str) -> Path:
        head = f"x_{unit},y_{unit},z_{unit},Bx_mT,By_mT,Bz_mT"
        path = tmp_path / f"{unit}.csv"
        np.savetxt(path, rows, delimiter=",", header=head, comments="")
        return path

    np.testing.assert_allclose(read_map(written("mm")).points_mm, grid)
    with pytest.raises(ConfigError, match=r"10 m; instead received 36 m: .* unit"):
        read_map(written("m"))


def test_a_python_function_is_a_source_too() -> None:
    turned = Cylinder(
        diameter_mm=40.0,
        length_mm=30.0,
        remanence_T=1.3,
        elevation_deg=20.0,
        gap_mm=50.0,
    )
    custom = sampled_map(lambda points: flux_mT(turned, points, length_mm=30.0), BOX)
    true = solve_spatial(gmc(2), turned).r_mm[-1]
    assert math.dist(true, solve_spatial(gmc(2), custom).r_mm[-1]) < 1e-3


def test_maps_that_cannot_be_are_refused() -> None:
    edges = [np.linspace(a, b, 6) for a, b in BOX.T]
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    swirl = np.column_stack([-grid[:, 1], grid[:, 0], 0.0 * grid[:, 2]])
    with pytest.raises(InputError, match="without curl and divergence"):
        FieldMap(points_mm=grid, flux_mT=swirl)
    near = Cuboid(sides_mm=10.0, remanence_T=1.3, centre_mm=(16.0, -20.0, 0.0))
    few = grid[(np.arange(216) % 3 == 0)]
    with pytest.raises(InputError, match="points_mm of a map must lie close enough"):
        FieldMap(points_mm=few, flux_mT=flux_mT(near, few, length_mm=30.0))
    with pytest.raises(InputError, match="at least 12"):
        FieldMap(points_mm=grid[:5], flux_mT=swirl[:5])
    small = FieldMap(
        points_mm=grid * 0.5, flux_mT=np.tile([0.0, 30.0, 0.0], (len(grid), 1))
    )
    with pytest.raises(InputError, match="leaves the box of the map"):
        solve(gmc(2), small)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (lambda: Field(), "at least one source"),
        (lambda: Field(3.0), "at least one source|sources of a field"),
        (lambda: solve(gmc(2), Cuboid(sides_mm=9.0, remanence_T=1.3)), "gap_mm must"),
        (
            lambda: solve(gmc(2), [
                Cuboid(sides_mm=55.0, remanence_T=1.3, gap_mm=60.0),
                Cylinder(diameter_mm=9.0, length_mm=9.0, remanence_T=1.3, gap_mm=80.0),
            ]),
            "must not overlap",
        ),
        (lambda: Cuboid(sides_mm=-1.0, remanence_T=1.0), "side_mm.*above zero"),
        (lambda: Cylinder(diameter_mm=1.0, length_mm=1.0, remanence_T=1305.0), "30 T"),
        (lambda: Dipole(), "either moment_A_m2"),
        (lambda: Coil(diameter_mm=9.0, current_A=math.nan), "finite"),
        (lambda: Gradient(gradient_mT_per_mm=np.eye(3)), "adds up to zero"),
        (lambda: Cuboid(sides_mm=9.0, remanence_T=1.0, gap_mm=1.0, centre_mm=(0, 0, 0)),
         "either centre_mm"),
        (lambda: solve(gmc(2), Coil(
            diameter_mm=20.0, current_A=1.0, wire_mm=2.0, centre_mm=(15.0, 0.0, 0.0))),
         "clear of"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_in_one_sentence(task: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        task()
    assert "\n" not in str(error.value)


def test_a_rod_passes_through_a_coil_but_not_through_its_winding() -> None:
    through = Coil(
        diameter_mm=20.0, current_A=50.0, turns=100, wire_mm=2.0, axis_angle_deg=90.0,
        elevation_deg=0.0, centre_mm=(15.0, 0.0, 0.0),
    )  # fmt: skip
    with pytest.raises(InputError, match="clear of"):
        solve(gmc(2), Coil(diameter_mm=20.0, current_A=1.0, centre_mm=(10.0, 0.0, 0.0)))
    along = solve(gmc(2), Field(
        Coil(diameter_mm=20.0, current_A=50.0, turns=100, axis_angle_deg=0.0,
             centre_mm=(15.0, 0.0, 0.0))
    ))  # fmt: skip
    assert abs(along.centreline.tip_mm[1]) < 1e-12
    assert through.in_plane


FILE = """
[[source]]
kind = "cuboid"
side_mm = 55.0
remanence_T = 1.305

[[source]]
kind = "uniform"
flux_mT = 5.0
"""


def test_files_hold_sources(tmp_path: Path) -> None:
    path = tmp_path / "field.toml"
    path.write_text(FILE, encoding="utf-8")
    field = read_field(path)
    assert field.follows_gap
    assert [source.kind for source in field.sources] == ["cuboid", "uniform"]
    for same in ("sides_mm = 55.0", "sides_mm = [55, 55, 55]"):
        path.write_text(FILE.replace("side_mm = 55.0", same), encoding="utf-8")
        assert read_field(path).sources == field.sources
    path.write_text(FILE.replace("side_mm = 55.0", "sides_mm = -5"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"sides_mm.*greater than 0"):
        read_field(path)
    path.write_text("side_mm = 55.0\nremanence_T = 1.305\n", encoding="utf-8")
    old = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0)
    assert read_field(path).at_gap(60.0).sources == old.sources
    for old_text, new, said in (
        ("side_mm = 55.0", "side = 55.0", "source 0 .cuboid.: unknown key .side."),
        ('"cuboid"', '"cubiod"', "kind must be one of.*cuboid.*'cubiod'"),
        ("flux_mT = 5.0", "", "source 1 .uniform.: the key .flux_mT. is missing"),
        ("remanence_T = 1.305", "remanence_T = 1305.0", "remanence_T: 1305 T .*in mT"),
    ):
        path.write_text(FILE.replace(old_text, new), encoding="utf-8")
        with pytest.raises(ConfigError, match=said):
            read_field(path)


def test_weight_acts_beside_any_source() -> None:
    from dataclasses import replace

    held = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    rod = replace(gmc(2), density_kg_m3=2640.0)
    found = solve(rod, PLANAR["cylinder"], support=held)
    assert verify(rod, PLANAR["cylinder"], found, support=held) < 1e-7


class _Elsewhere:
    """A kind of source that another package offers, in plain Python."""

    def __init__(self, flux_mT: float) -> None:
        self.flux = flux_mT
        self.box_mm = BOX

    def flux_mT(self, points_mm: np.ndarray) -> np.ndarray:
        return np.tile([0.0, self.flux, 0.0], (len(points_mm), 1))


def test_other_packages_offer_kinds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "magbend.sim.sources.load_plugin", lambda _group, _kind, own: _Elsewhere
    )
    path = tmp_path / "field.toml"
    path.write_text('[[source]]\nkind = "elsewhere"\nflux_mT = 50.0\n')
    found = solve(gmc(2), read_field(path)).centreline.tip_mm
    same = solve(gmc(2), UniformField(flux_mT=50.0)).centreline.tip_mm
    assert math.dist(found, same) < 1e-3
    path.write_text('[[source]]\nkind = "elsewhere"\n')
    with pytest.raises(ConfigError, match=r"source 0 .elsewhere."):
        read_field(path)
