"""Many rods in space against single ones."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.sim import (
    Cuboid,
    Dipole,
    Field,
    MagnetField,
    Rod,
    Section,
    Support,
    Uniform,
    solve_spatial,
    solve_spatial_many,
)
from magbend.sim.batch import OUTCOMES

HELD = Support(gravity_m_s2=(2.0, -3.0, -9.0), clamp_angle_deg=20.0, load_factor=0.9)
CUBE = Magnet.cube(40.0, 1.2, elevation_deg=25.0, offset_mm=(4.0, 3.0, 6.0))
SHAPES = {
    "square": {"side_mm": (0.7, 1.2)},
    "rectangle": {"width_mm": (0.7, 1.2), "height_mm": (0.5, 1.0)},
    "tube": {"diameter_mm": (0.9, 1.3), "bore_mm": (0.1, 0.5)},
}


def draw(rng, n: int, shape: str) -> dict:
    sizes = {name: rng.uniform(*ends, (n, 2)) for name, ends in SHAPES[shape].items()}
    return sizes | {
        "length_mm": rng.uniform(5.0, 15.0, (n, 2)),
        "E_MPa": rng.uniform(5.0, 30.0, (n, 2)),
        "remanence_mT": rng.uniform(-40.0, 40.0, (n, 2)),
        "remanence_y_mT": rng.uniform(-10.0, 10.0, (n, 2)),
        "remanence_z_mT": rng.uniform(-10.0, 10.0, n),
        "natural_curvature_per_mm": rng.uniform(-0.03, 0.03, (n, 2)),
        "density_kg_m3": rng.uniform(1000.0, 3000.0, n),
    }


def one(designs: dict, i: int, shape: str) -> Rod:
    own = {name: values[i] for name, values in designs.items()}
    wide = [name for name in own if np.ndim(own[name])]
    sections = tuple(
        Section(**{name: float(own[name][k]) for name in wide}) for k in range(2)
    )
    first = {name: float(own[name][0]) for name in SHAPES[shape]}
    return Rod(
        name="one", shape=shape, sections=sections, remanence_mT=0.0,
        remanence_z_mT=float(own["remanence_z_mT"]),
        density_kg_m3=float(own["density_kg_m3"]), **first,
    )  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("source", ["uniform", "cube", "sum"])
def test_designs_are_the_single_rods(shape: str, source: str) -> None:
    """Within both bounds, with the same outcome and index; some are pulled in."""
    rng = np.random.default_rng([len(shape), len(source)])
    n = 12
    designs = draw(rng, n, shape)
    if source == "uniform":
        case = {
            "flux_mT": rng.uniform(-60.0, 60.0, n),
            "angle_deg": rng.uniform(-180.0, 180.0, n),
            "elevation_deg": rng.uniform(-80.0, 80.0, n),
        }
        found = solve_spatial_many(designs | case, support=HELD)
    else:
        case = {"gap_mm": rng.uniform(10.0, 60.0, n)}
        field = Field(
            Cuboid(sides_mm=30.0, remanence_T=1.2),
            Dipole(moment_A_m2=2.0, centre_mm=(20.0, 0.0, 60.0)),
        )
        before = CUBE if source == "cube" else field
        found = solve_spatial_many(designs | case, magnet=before, support=HELD)
    for i in range(n):
        if source == "uniform":
            names = ("flux_mT", "angle_deg", "elevation_deg")
            at = Field(Uniform(**{name: case[name][i] for name in names}))
        elif source == "cube":
            at = MagnetField(magnet=CUBE, gap_mm=case["gap_mm"][i])
        else:
            at = field.at_gap(case["gap_mm"][i])
        rod = one(designs, i, shape)
        if OUTCOMES[found["outcome"][i]] == "touches the magnet":
            with pytest.raises(InputError, match="undeformed rod clear"):
                solve_spatial(rod, at, support=HELD)
            continue
        space = solve_spatial(rod, at, support=HELD, points=2)
        assert OUTCOMES[found["outcome"][i]] == space.status
        assert found["morse_index"][i] == space.morse_index
        if len(space.s_mm):
            tip = [found[i][f"tip_{axis}_mm"] for axis in "xyz"]
            bound = found["error_mm"][i] + space.error_mm
            assert np.abs(space.r_mm[-1] - tip).max() < bound < 1e-3
            tangent = [found[i][f"tangent_{axis}"] for axis in "xyz"]
            assert space.tangent[-1] == pytest.approx(tangent, abs=1e-5)


def test_what_is_wrong_with_designs_is_said() -> None:
    good = {
        "length_mm": [10.0], "E_MPa": [10.0], "side_mm": 1.0, "remanence_mT": 20.0,
        "flux_mT": 10.0,
    }  # fmt: skip
    assert np.isfinite(solve_spatial_many(good)["tip_x_mm"]).all()
    for wrong, words in (
        ({"flux_mT": np.nan}, "flux_mT"),
        ({"elevation_deg": 91.0}, "elevation_deg"),
        ({"weight": 1.0}, "may have angle_deg"),
        ({"remanence_y_mT": [1.0, 2.0, 3.0], "E_MPa": [[1.0], [2.0]]}, "must fit"),
    ):
        with pytest.raises(InputError, match=words):
            solve_spatial_many(good | wrong)
    with pytest.raises(InputError, match="density_kg_m3"):
        solve_spatial_many(good, support=HELD)
    with pytest.raises(InputError, match="magnet must be"):
        solve_spatial_many(good, magnet="cube")
    too_much = solve_spatial_many(good | {"flux_mT": 3e4, "E_MPa": [0.001]})
    assert OUTCOMES[too_much["outcome"][0]] == "not solved"
