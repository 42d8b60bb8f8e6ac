"""One rod in plain Python is the rod that machine code finds."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.jit import once
from magbend.core.magnet import Magnet
from magbend.sim import MagnetField, Support, UniformField, gmc, solve
from magbend.sim.equilibria.find import find_equilibria
from magbend.sim.equilibria.folds import trace_branches

CUBE = Magnet.cube(55.0, 1.305)


def assert_same(rod, field, **options) -> None:
    plain = once(lambda: solve(rod, field, **options))
    compiled = solve(rod, field, **options)
    assert plain.status == compiled.status
    assert plain.morse_index == compiled.morse_index
    assert plain.load_limit == pytest.approx(compiled.load_limit, abs=1e-6)
    if compiled.centreline is not None:
        apart = np.abs(plain.centreline.points_mm - compiled.centreline.points_mm)
        assert apart.max() <= plain.error_mm + compiled.error_mm
        assert plain.root_moment_Nm == pytest.approx(
            compiled.root_moment_Nm, rel=1e-9, abs=1e-18
        )


@settings(max_examples=25, deadline=None)
@given(
    number=st.integers(1, 7),
    flux_mT=st.floats(-3000.0, 3000.0),
    angle_deg=st.floats(-180.0, 180.0),
    clamp_deg=st.floats(-180.0, 180.0),
    model=st.sampled_from(["rod", "rod", "solid"]),
)
def test_uniform_fields(number, flux_mT, angle_deg, clamp_deg, model) -> None:
    if model == "solid":
        flux_mT /= 20.0
    assert_same(
        gmc(number),
        UniformField(flux_mT=flux_mT, angle_deg=angle_deg),
        support=Support(clamp_angle_deg=clamp_deg),
        model=model,
    )


@settings(max_examples=15, deadline=None)
@given(
    sign=st.sampled_from([-1.0, 1.0]),
    gap_mm=st.floats(15.0, 120.0),
    weight=st.floats(-9.81, 9.81),
)
def test_magnets_and_weight_in_the_plane(sign, gap_mm, weight) -> None:
    rod = replace(gmc(2), remanence_mT=sign * 20.07, density_kg_m3=2640.0)
    assert_same(
        rod,
        MagnetField(magnet=CUBE, gap_mm=gap_mm),
        support=Support(gravity_m_s2=(0.0, weight, 0.0)),
    )


@pytest.mark.parametrize("flux_mT", [50.0, 400.0])
def test_weight_out_of_the_plane(flux_mT: float) -> None:
    assert_same(
        replace(gmc(2), density_kg_m3=2640.0),
        UniformField(flux_mT=flux_mT),
        support=Support(gravity_m_s2=(0.0, 0.0, -9.80665)),
    )


def test_equilibria_and_folds() -> None:
    field = UniformField(flux_mT=300.0, angle_deg=178.0)
    plain = once(lambda: find_equilibria(gmc(2), field))
    compiled = find_equilibria(gmc(2), field)
    assert [one.morse_index for one in plain] == [one.morse_index for one in compiled]
    for one, other in zip(plain, compiled, strict=True):
        assert one.tip_mm == pytest.approx(other.tip_mm, abs=1e-9)
    folds = [
        [fold.flux_mT for branch in branches for fold in branch.folds]
        for branches in (
            once(lambda: trace_branches(gmc(2), field)),
            trace_branches(gmc(2), field),
        )
    ]
    assert folds[0] == pytest.approx(folds[1], rel=1e-9)
    assert len(folds[0]) > 0


@pytest.mark.parametrize(
    "call",
    [
        "solve(gmc(2), MagnetField(magnet=Magnet.cube(55.0, 1.3), gap_mm=60.0))",
        "solve_spatial(gmc(2), UniformField(flux_mT=50.0))",
        "solve_many({'length_mm': [10, 20], 'E_MPa': [20, 10], 'side_mm': 1.0,"
        " 'remanence_mT': 20.0, 'flux_mT': [30.0, 50.0]})",
    ],
)
def test_the_first_call_from_python_compiles_nothing(call: str, tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from magbend.core.magnet import Magnet\n"
        "from magbend.sim import gmc, solve, solve_many, solve_spatial\n"
        "from magbend.sim import MagnetField, UniformField\n"
        f"{call}\n"
        "from magbend.core.jit import Kernel\n"
        "import gc\n"
        "kernels = [one for one in gc.get_objects() if isinstance(one, Kernel)]\n"
        "made = [k for k in kernels if k._compiled and k._compiled.overloads]\n"
        "print(len(kernels) > 50, len(made))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.stdout.split() == ["True", "0"]
