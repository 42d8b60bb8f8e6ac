"""The check solver converges as it says, and agrees with the marching solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.check.against import verify
from magbend.sim.check.energy import discretise, energy, hessian
from magbend.sim.check.solver import check_solve
from magbend.sim.one_rod import solve

CUBE = Magnet.cube(55.0, 1.305)
WEIGHT = Support(gravity_m_s2=(1.0, -9.8, 0.0), clamp_angle_deg=5.0)
FIELDS = [
    UniformField(flux_mT=50.0),
    UniformField(flux_mT=120.0, angle_deg=150.0),
    MagnetField(magnet=CUBE, gap_mm=50.0),
    MagnetField(magnet=replace(CUBE, axis_angle_deg=60.0), gap_mm=40.0),
    MagnetField(magnet=replace(CUBE, offset_mm=(10.0, 4.0, 0.0)), gap_mm=45.0),
]


def rod(sign: float):
    return replace(gmc(2), remanence_mT=sign * 20.07, density_kg_m3=2640.0)


@pytest.mark.parametrize("field", FIELDS, ids=range(len(FIELDS)))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("support", [Support(), WEIGHT], ids=["light", "heavy"])
def test_pole_load_equals_distributed_load(field, sign: float, support) -> None:
    """1e-9 relative is asked for; the tip deflects by millimetres."""
    solution = solve(rod(sign), field, support=support)
    assert verify(rod(sign), field, solution, support=support) < 1e-11


def test_jumps_of_side_and_remanence() -> None:
    parts = (
        Section(length_mm=8.0, E_MPa=20.0, side_mm=1.2, remanence_mT=30.0),
        Section(length_mm=12.0, E_MPa=5.0, remanence_mT=-10.0),
        Section(length_mm=10.0, E_MPa=9.0, side_mm=0.8),
    )
    jumpy = replace(gmc(2), sections=parts)
    for field in FIELDS:
        assert verify(jumpy, field, solve(jumpy, field)) < 1e-11


@pytest.mark.parametrize(("degree", "order"), [(1, 2.0), (2, 4.0), (3, 6.0)])
def test_order_of_convergence(degree: int, order: float) -> None:
    field = UniformField(flux_mT=120.0)
    exact = solve(gmc(2), field).centreline.tip_mm
    errors = [
        np.hypot(
            *np.subtract(
                check_solve(gmc(2), field, degree=degree, elements=n).tip_mm, exact
            )
        )
        for n in (2, 4)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_richardson_extrapolation_of_linear_elements() -> None:
    field = UniformField(flux_mT=50.0)
    exact = np.array(solve(gmc(2), field).centreline.tip_mm)
    coarse, middle, fine = (
        np.array(check_solve(gmc(2), field, degree=1, elements=n).tip_mm)
        for n in (8, 16, 32)
    )
    once = [(4.0 * b - a) / 3.0 for a, b in ((coarse, middle), (middle, fine))]
    assert np.abs((16.0 * once[1] - once[0]) / 15.0 - exact).max() < 1e-9


@pytest.mark.parametrize("field", FIELDS[1:3], ids=["uniform", "cube"])
def test_gradient_and_hessian_are_derivatives_of_the_energy(field) -> None:
    grid = discretise(rod(1.0), WEIGHT, np.array([0.0, 0.01, 0.02, 0.03]), 4)
    theta = np.linspace(0.1, 0.7, grid.angle.shape[1])
    _, gradient, _, _ = energy(grid, field, 30.0, theta, 1.0)
    H = hessian(grid, field, 30.0, theta, 1.0)
    step = 1e-5
    scale = np.abs(gradient).max(), np.abs(H).max()
    for k in range(len(theta)):
        e = np.zeros(len(theta))
        e[k] = step
        up = energy(grid, field, 30.0, theta + e, 1.0)
        down = energy(grid, field, 30.0, theta - e, 1.0)
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(
            gradient[k], abs=1e-6 * scale[0]
        )
        assert (up[1] - down[1]) / (2 * step) == pytest.approx(
            H[k], abs=1e-7 * scale[1]
        )


def test_a_wrong_shape_is_found_out() -> None:
    field = UniformField(flux_mT=50.0)
    solution = solve(gmc(2), UniformField(flux_mT=51.0))
    assert verify(gmc(2), field, solution) > 0.05


def test_cold_start_reaches_the_same() -> None:
    field = MagnetField(magnet=CUBE, gap_mm=60.0)
    check = check_solve(gmc(2), field)
    assert check.tip_mm == pytest.approx(
        solve(gmc(2), field).centreline.tip_mm, abs=1e-11
    )
    assert check.morse_index == 0


def test_bad_input_is_refused() -> None:
    field = UniformField(flux_mT=50.0)
    with pytest.raises(InputError, match="gravity"):
        check_solve(gmc(2), field, support=Support(gravity_m_s2=(0.0, 0.0, -9.8)))
    with pytest.raises(InputError, match="density"):
        check_solve(gmc(2), field, support=Support(gravity_m_s2=(0.0, -9.8, 0.0)))
