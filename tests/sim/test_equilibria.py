"""Counts, indices and folds against closed forms and an independent Hessian."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

from magbend.core.errors import InputError
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0
from magbend.sim import Support, UniformField, gmc
from magbend.sim.check.solver import check_solve
from magbend.sim.equilibria.find import find_equilibria
from magbend.sim.equilibria.folds import find_folds, trace_branches
from magbend.sim.one_rod import solve

SIM = Path(__file__).parents[2] / "fixtures" / "sim"
CASES = json.loads((SIM / "equilibria.json").read_text())
ROD = Specimen(
    name="bar", side_mm=1.0, remanence_mT=100.0,
    sections=(Section(length_mm=30.0, E_MPa=10.0),),
)  # fmt: skip
UNIT_mT = 1e7 * 1e-12 / 12.0 / (1e-6 * 0.1 / MU0 * 0.03**2) * 1e3
"""Flux density at which m B L^2 / EI of that bar is 1."""


def uniform(beta: float, angle_deg: float) -> UniformField:
    return UniformField(flux_mT=beta * UNIT_mT, angle_deg=angle_deg)


def closed_form_count(beta: float, phi_deg: float) -> int:
    """Count roots of the elliptic-integral condition, by modulus, to high density.

    With k the sine of half the swing's amplitude from the centre phi - 180 deg, a rod
    that starts at the clamp's place on the swing reaches a turning point after
    K - F, K + F, 3K - F, ... quarter periods over sqrt(beta).
    """
    start = np.sin(np.radians(180.0 - phi_deg) / 2.0)
    m = np.concatenate(
        [
            start**2 + (1.0 - start**2) * np.geomspace(1e-14, 1.0, 40000)[:-1],
            1.0 - (1.0 - start**2) * np.geomspace(1e-14, 1.0, 40000),
        ]
    )
    m = np.unique(np.clip(m, start**2, 1.0 - 1e-16))
    quarter = ellipk(m)
    part = ellipkinc(np.arcsin(np.minimum(1.0, start / np.sqrt(m))), m)
    count = 0
    for turn in range(1, 12, 2):
        for sign in (-1.0, 1.0):
            miss = turn * quarter + sign * part - np.sqrt(beta)
            count += int(np.sum(miss[:-1] * miss[1:] < 0.0))
    return count


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"beta{c['beta']}")
def test_reference(case) -> None:
    found = find_equilibria(ROD, uniform(case["beta"], case["phi_deg"]))
    tips = [float(text) for text in case["theta_tip_rad"]]
    assert [one.morse_index for one in found] == case["morse_index"]
    assert [one.theta_tip_rad for one in found] == pytest.approx(tips, abs=1e-10)


@pytest.mark.parametrize("phi", [90.0, 120.0, 150.0, 179.0, 179.9])
@pytest.mark.parametrize("beta", [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])
def test_count_is_that_of_the_closed_form(beta: float, phi: float) -> None:
    assert len(find_equilibria(ROD, uniform(beta, phi))) == closed_form_count(beta, phi)


def test_counts_at_179_degrees() -> None:
    counts = [len(find_equilibria(ROD, uniform(b, 179.0))) for b in (2, 5, 20, 50, 100)]
    assert counts == [1, 3, 3, 5, 7]


def test_elastica_table() -> None:
    for row in np.loadtxt(SIM / "elastica_uniform.csv", delimiter=",", skiprows=1):
        found = find_equilibria(ROD, uniform(row[1], row[0]))
        one = min(found, key=lambda e: abs(e.theta_tip_rad - row[2]))
        assert one.theta_tip_rad == pytest.approx(row[2], abs=1e-12)
        assert one.tip_mm == pytest.approx((30.0 * row[4], 30.0 * row[5]), abs=1e-11)


@pytest.mark.parametrize("number", [2, 6])
def test_index_is_that_of_the_hessian(number: int) -> None:
    """Negative eigenvalues of another discretisation; graded rods, strong field."""
    field = UniformField(flux_mT=4000.0, angle_deg=160.0)
    found = find_equilibria(gmc(number), field, points=201)
    assert len(found) >= 5
    for one in found:
        start = (one.centreline.s_mm, one.centreline.theta_rad)
        check = check_solve(gmc(number), field, start=start, elements=3)
        assert check.theta_tip_rad == pytest.approx(one.theta_tip_rad, abs=1e-8)
        assert check.morse_index == one.morse_index


@settings(max_examples=20, deadline=None)
@given(
    flux=st.floats(1.0, 3000.0),
    angle=st.floats(-179.0, 179.0),
    number=st.integers(1, 7),
)
def test_odd_number_alternating_and_the_solved_one_among_them(
    flux: float, angle: float, number: int
) -> None:
    field = UniformField(flux_mT=flux, angle_deg=angle)
    found = find_equilibria(gmc(number), field)
    assert len(found) % 2 == 1
    assert sum((-1) ** one.morse_index for one in found) == 1
    solved = solve(gmc(number), field).centreline
    assert min(abs(one.theta_tip_rad - solved.theta_rad[-1]) for one in found) < 1e-9


def test_an_angle_that_has_lost_its_digits_is_none() -> None:
    """Below the least normal number the march lost the rod at 2e-313 degrees."""
    tip = solve(gmc(7), UniformField(flux_mT=1977.0, angle_deg=2.3e-313)).centreline
    assert tip.tip_mm == pytest.approx((30.0, 0.0), abs=1e-12)


def test_opposite_magnetisation_is_the_opposite_field() -> None:
    turned = replace(ROD, remanence_mT=-100.0)
    one = find_equilibria(ROD, uniform(20.0, 60.0))
    two = find_equilibria(turned, uniform(20.0, -120.0))
    assert [e.theta_tip_rad for e in one] == pytest.approx(
        [e.theta_tip_rad for e in two], abs=1e-12
    )


def test_no_field_leaves_the_clamp_s_direction() -> None:
    (only,) = find_equilibria(
        ROD, uniform(0.0, 90.0), support=Support(clamp_angle_deg=30.0)
    )
    assert only.theta_tip_rad == pytest.approx(np.radians(30.0), abs=1e-15)
    assert only.status == "stable"


def test_field_along_the_rod() -> None:
    (only,) = find_equilibria(ROD, uniform(50.0, 0.0))
    assert (only.theta_tip_rad, only.morse_index) == (0.0, 0)
    three = find_equilibria(ROD, uniform(10.0, 180.0))
    assert [one.morse_index for one in three] == [0, 1, 0]
    assert three[1].theta_tip_rad == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("phi", "beta"),
    [
        (90.0, 10.3251607395808), (120.0, 7.16202930751652), (150.0, 4.84858825461145),
        (175.0, 3.05292042380396), (179.0, 2.65694720638730), (179.9, 2.50734576166972),
    ],
)  # fmt: skip
def test_fold_loads(phi: float, beta: float) -> None:
    fold = find_folds(ROD, uniform(20.0, phi))[0]
    assert fold.flux_mT / UNIT_mT == pytest.approx(beta, rel=2e-14)
    assert fold.kind == "fold"


def test_euler_loads() -> None:
    folds = find_folds(ROD, uniform(100.0, 180.0))
    loads = [fold.flux_mT / UNIT_mT / (np.pi / 2.0) ** 2 for fold in folds]
    assert loads == pytest.approx([1.0, 9.0, 25.0], rel=1e-12)
    assert {fold.kind for fold in folds} == {"pitchfork"}


def test_graded_euler_load_by_another_road() -> None:
    """Straight GMC 2 buckles where the linear shooting determinant vanishes."""
    rod = gmc(2)
    EI = np.array([part.E_MPa for part in rod.sections][::-1]) * 1e6 * 1e-12 / 12.0

    def slope(flux_mT: float) -> float:
        q, m = 1.0, 0.0
        for stiffness in EI:
            k = np.sqrt(1e-6 * rod.remanence_mT / MU0 * flux_mT * 1e-6 / stiffness)
            c, s = np.cos(k * 0.01), np.sin(k * 0.01)
            q, m = c * q + s * m / (k * stiffness), -s * k * stiffness * q + c * m
        return q

    first = find_folds(rod, UniformField(flux_mT=400.0, angle_deg=180.0))[0]
    assert first.flux_mT == pytest.approx(brentq(slope, 100.0, 400.0), rel=1e-11)


@pytest.mark.parametrize("angle", [150.0, 179.9])
def test_every_equilibrium_lies_on_a_branch(angle: float) -> None:
    field = UniformField(flux_mT=6000.0, angle_deg=angle)
    found = find_equilibria(gmc(2), field)
    branches = trace_branches(gmc(2), field)
    ends = []
    for branch in branches:
        full = np.flatnonzero(np.abs(branch.flux_mT - 6000.0) < 1e-9)
        ends += [branch.theta_tip_rad[i] for i in full]
        for i in np.flatnonzero(np.diff(branch.morse_index)):
            assert abs(branch.morse_index[i + 1] - branch.morse_index[i]) == 1
    tips = [one.theta_tip_rad for one in found]
    assert sorted(ends) == pytest.approx(tips, abs=1e-9)
    folds = sum(len(branch.folds) for branch in branches)
    assert len(found) == 1 + 2 * folds


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="gravity_m_s2"):
        find_equilibria(
            ROD, uniform(1.0, 90.0), support=Support(gravity_m_s2=(0.0, -9.8, 0.0))
        )
    soft = replace(ROD, sections=(Section(length_mm=300.0, E_MPa=0.01),))
    with pytest.raises(InputError, match="flux_mT"):
        find_equilibria(soft, UniformField(flux_mT=20000.0))
