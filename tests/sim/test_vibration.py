"""Natural frequencies: closed forms, and transfer matrices of the same beam."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from magbend.core import Section, Specimen
from magbend.core.errors import InputError
from magbend.sim import first_mode

ROD = Specimen(
    name="rod", side_mm=1.0, remanence_mT=20.0, density_kg_m3=2640.0,
    sections=(
        Section(length_mm=8.0, E_MPa=24.0),
        Section(length_mm=12.0, E_MPa=9.0),
        Section(length_mm=10.0, E_MPa=3.0),
    ),
)  # fmt: skip
UNIFORM = replace(ROD, sections=(Section(length_mm=30.0, E_MPa=10.0),))


def by_transfer_matrices(specimen):
    """Return the first frequency at which clamp and free end go together, Hz.

    A section carries deflection, slope, moment and shear force over its length by the
    exponential of its equation; free of moment and force at the tip, the determinant
    of what the clamp's moment and force do there is zero.
    """
    from scipy.linalg import expm
    from scipy.optimize import brentq

    def determinant(frequency_Hz):
        whole = np.eye(4)
        for section, cut in zip(
            specimen.sections, specimen.cross_sections, strict=True
        ):
            EI = 1e-6 * section.E_MPa * cut.in_plane_mm4
            mass = 1e-6 * specimen.density_kg_m3 * cut.area_mm2
            rate = np.zeros((4, 4))
            rate[0, 1], rate[1, 2], rate[2, 3] = 1.0, 1.0 / EI, 1.0
            rate[3, 0] = mass * (2.0 * math.pi * frequency_Hz) ** 2
            whole = expm(1e-3 * section.length_mm * rate) @ whole
        return float(np.linalg.det(whole[2:, 2:]))

    grid = np.linspace(0.5, 60.0, 120)
    signs = np.sign([determinant(f) for f in grid])
    first = int(np.flatnonzero(np.diff(signs))[0])
    return brentq(determinant, grid[first], grid[first + 1], xtol=1e-10)


def test_a_uniform_rod_rings_as_the_closed_form_says():
    EI, mass, length = 10e6 / 12.0 * 1e-12, 2640.0 * 1e-6, 0.03
    exact = 1.875104068711961**2 / (2.0 * math.pi * length**2) * math.sqrt(EI / mass)
    assert first_mode(UNIFORM).frequency_Hz == pytest.approx(exact, rel=1e-6)
    cut = tuple(Section(length_mm=length, E_MPa=10.0) for length in (5.0, 21.0, 4.0))
    parts = first_mode(replace(UNIFORM, sections=cut))
    assert parts.frequency_Hz == pytest.approx(exact, rel=1e-6)


def test_a_graded_rod_rings_as_transfer_matrices_say():
    tube = Specimen(
        name="tube", shape="tube", diameter_mm=1.5, bore_mm=0.6, remanence_mT=0.0,
        density_kg_m3=1800.0, sections=ROD.sections,
    )  # fmt: skip
    for rod in (ROD, tube):
        exact = by_transfer_matrices(rod)
        assert first_mode(rod).frequency_Hz == pytest.approx(exact, rel=1e-6)


def test_the_shares_are_what_a_modulus_does_to_the_frequency():
    mode = first_mode(ROD)
    assert sum(mode.shares) == pytest.approx(1.0)
    for k, share in enumerate(mode.shares):
        sections = list(ROD.sections)
        sections[k] = replace(sections[k], E_MPa=1.001 * sections[k].E_MPa)
        stiffer = first_mode(replace(ROD, sections=tuple(sections)))
        gain = 2.0 * math.log(stiffer.frequency_Hz / mode.frequency_Hz)
        assert gain / math.log(1.001) == pytest.approx(share, abs=1e-3)


def test_a_rod_without_density_cannot_ring():
    with pytest.raises(InputError, match="density_kg_m3"):
        first_mode(replace(ROD, density_kg_m3=None))
