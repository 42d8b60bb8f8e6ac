"""The field of the cuboid, against 40-digit numbers, magpylib and its own physics."""

from __future__ import annotations

import json
from pathlib import Path

import magpylib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.sim import magnet_flux_mT, magnet_gradient_mT_per_mm
from magbend.sim.magnet.field import (
    FAR,
    cuboid_flux,
    dipole_flux,
    inside,
    magnet_block,
    plane_flux,
)

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "sim"
CUBE = np.array([27.5, 27.5, 27.5, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1.305])


def own_frame(sides: tuple[float, float, float]) -> np.ndarray:
    """A block whose frame is the magnet's own."""
    block = CUBE.copy()
    block[:3] = np.array(sides) / 2.0
    return block


def field(block: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out = np.empty(12)
    cuboid_flux(block, *point, out)
    return out[:3].copy(), out[3:].reshape(3, 3).copy()


def test_agrees_with_forty_digits() -> None:
    data = json.loads((FIXTURES / "cube_field.json").read_text(encoding="utf-8"))
    for row in data["points"]:
        flux, gradient = field(CUBE, np.array(row["p_mm"], dtype=float))
        wanted = np.array(row["B_T"], dtype=float)
        slopes = np.array(row["dBi_dxj_T_per_m"], dtype=float) * 1e-3
        assert np.abs(flux - wanted).max() < 5e-15 * np.abs(wanted).max()
        assert np.abs(gradient - slopes).max() < 2e-14 * np.abs(slopes).max()


@pytest.mark.parametrize("sides", [(55.0, 55.0, 55.0), (20.0, 40.0, 10.0)])
def test_agrees_with_magpylib_near_the_magnet(sides: tuple[float, ...]) -> None:
    source = magpylib.magnet.Cuboid(polarization=(0, 0, 1.305), dimension=sides)
    rng = np.random.default_rng(1)
    block = own_frame(sides)
    points = rng.normal(size=(400, 3))
    points *= (
        rng.uniform(0.9, 1.6, 400) * max(sides) / np.linalg.norm(points, axis=1)
    )[:, None]
    wanted = source.getB(points)
    for point, reference in zip(points, wanted, strict=True):
        flux, _ = field(block, point)
        assert np.abs(flux - reference).max() < 1e-12 * np.abs(reference).max()


@pytest.mark.parametrize("sides", [(55.0, 55.0, 55.0), (10.0, 40.0, 20.0)])
def test_the_two_formulas_meet(sides: tuple[float, ...]) -> None:
    block = own_frame(sides)
    rng = np.random.default_rng(2)
    for _ in range(50):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        edge = FAR * max(sides) * direction
        near, near_slopes = field(block, edge * (1.0 - 1e-13))
        far, far_slopes = field(block, edge * (1.0 + 1e-13))
        assert np.abs(near - far).max() < 2e-12 * np.abs(far).max()
        assert np.abs(near_slopes - far_slopes).max() < 2e-12 * np.abs(far_slopes).max()


def test_far_away_it_is_a_dipole() -> None:
    # A cube has no quadrupole or octupole: at 100 sides the rest is below 1e-8.
    point = np.array([3300.0, -2200.0, 3800.0])
    flux, gradient = field(CUBE, point)
    dipole = np.empty(12)
    moment = np.array([0.0, 0.0, 1.305 * 55.0**3 / (4.0 * np.pi)])
    dipole_flux(moment, *point, dipole)
    assert np.abs(flux - dipole[:3]).max() < 1e-8 * np.abs(flux).max()
    slopes = dipole[3:].reshape(3, 3)
    assert np.abs(gradient - slopes).max() < 1e-7 * np.abs(gradient).max()


@pytest.mark.parametrize(
    "point",
    [
        (0.0, 0.0, 60.0),  # axis
        (27.5, 0.0, 60.0),  # in the plane of a side
        (27.5, 27.5, 60.0),  # on the extension of an edge
        (27.5, 90.0, 27.5),
        (90.0, 27.5, 27.5),
        (90.0, 0.0, 27.5),  # in the plane of the N face
        (27.500001, 0.0, 0.0),  # close to a side
        (5500.0, 0.0, 0.0),
        (0.0, 0.0, -5500.0),
    ],
)
def test_special_points_agree_with_their_neighbours(point: tuple[float, ...]) -> None:
    here = np.array(point)
    flux, gradient = field(CUBE, here)
    assert np.all(np.isfinite(flux))
    assert np.all(np.isfinite(gradient))
    shift = 1e-6 * np.array([0.6, 0.64, 0.48])
    beside, _ = field(CUBE, here + shift)
    assert np.abs(flux + gradient @ shift - beside).max() < 1e-9 * np.abs(flux).max()


@settings(max_examples=60, deadline=None)
@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(
        lambda v: np.linalg.norm(v) > 0.1
    ),
    distance=st.floats(1.0, 100.0),
)
def test_no_curl_no_divergence_and_the_right_slope(
    direction: tuple[float, ...], distance: float
) -> None:
    point = np.array(direction) / np.linalg.norm(direction) * 55.0 * distance
    _, gradient = field(CUBE, point)
    size = np.abs(gradient).max()
    assert abs(np.trace(gradient)) <= 1e-12 * size
    assert np.abs(gradient - gradient.T).max() <= 1e-12 * size
    step = 1e-3 * np.linalg.norm(point)
    axis = np.eye(3) * step
    weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    slopes = np.zeros((3, 3))
    for j in range(3):
        for k, w in weights:
            up, _ = field(CUBE, point + k * axis[j])
            down, _ = field(CUBE, point - k * axis[j])
            slopes[:, j] += w * (up - down) / step
    assert np.abs(slopes - gradient).max() < 1e-9 * size


def test_the_plane_formula_is_the_general_one() -> None:
    rng = np.random.default_rng(4)
    out = np.empty(12)
    for _ in range(500):
        magnet = Magnet(
            sides_mm=tuple(rng.uniform(15.0, 60.0, 3)),
            remanence_T=1.3,
            axis_angle_deg=rng.uniform(-180, 180),
        )
        gap_mm = float(rng.uniform(1, 300))
        block = magnet_block(magnet, length_mm=30.0, gap_mm=gap_mm)
        x, y = rng.uniform(-300, 300, 2)
        if inside(block, x, y, 0.0, 1.0):
            continue
        cuboid_flux(block, x, y, 0.0, out)
        plane = np.array(plane_flux(block, x, y))
        size, slope = np.linalg.norm(out[:3]), np.abs(out[3:]).max()
        assert np.abs(plane[:2] - out[:2]).max() < 1e-11 * size
        assert np.abs(plane[2:] - out[[3, 4, 7]]).max() < 1e-11 * slope


@pytest.mark.parametrize("across", [0.0, 10.0, 27.5, 27.6, 80.0])
@pytest.mark.parametrize("along", [0.0, 27.5, 27.5001, 40.0, -27.5, -27.5001])
def test_the_plane_formula_loses_no_turn_close_to_faces(
    across: float, along: float
) -> None:
    block = magnet_block(Magnet.cube(55.0, 1.305), length_mm=0.0, gap_mm=0.0)
    x, y = across, along - 27.5
    if inside(block, x, y, 0.0, 1e-6):
        return
    out = np.empty(12)
    cuboid_flux(block, x, y, 0.0, out)
    plane = plane_flux(block, x, y)
    assert np.abs(plane[:2] - out[:2]).max() < 1e-12


def test_default_bench_points_along_y_at_the_tip() -> None:
    cube = Magnet.cube(55.0, 1.305)
    flux = magnet_flux_mT(cube, (30.0, 0.0, 0.0), length_mm=30.0, gap_mm=60.0)
    assert flux[1] == pytest.approx(50.0003843, abs=1e-6)
    assert np.abs(flux[[0, 2]]).max() < 1e-12
    slopes = magnet_gradient_mT_per_mm(cube, (30, 0, 0), length_mm=30.0, gap_mm=60.0)
    assert slopes[1, 1] == pytest.approx(-1.6469286, abs=1e-6)


@pytest.mark.parametrize("point", [(30.0, -70.0, 0.0), (30.0, -60.0, 0.0)])
def test_points_in_or_on_the_magnet_are_refused(point: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match=r"outside the magnet.*mm"):
        magnet_flux_mT(Magnet.cube(55.0, 1.3), point, length_mm=30.0, gap_mm=60.0)


def test_nan_is_refused() -> None:
    with pytest.raises(InputError, match="points_mm"):
        magnet_flux_mT(
            Magnet.cube(55.0, 1.3), (np.nan, 0.0, 0.0), length_mm=30.0, gap_mm=60.0
        )
