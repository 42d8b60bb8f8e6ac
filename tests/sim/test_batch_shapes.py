"""Many shapes at once are the same shapes that `solve` gives one by one."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import MagnetField, UniformField, gmc, solve
from magbend.sim.batch.shapes import STATUS, Designs, designs_of, solve_shapes


def random_designs(n: int, *, magnet: bool) -> Designs:
    rng = np.random.default_rng(3)
    load = rng.uniform(45.0, 90.0, n) if magnet else rng.uniform(5.0, 150.0, n)
    return Designs(
        length_mm=rng.uniform(5.0, 20.0, (n, 3)),
        E_MPa=rng.uniform(6.0, 48.0, (n, 3)),
        side_mm=rng.uniform(0.75, 1.35, n),
        remanence_mT=rng.uniform(14.0, 26.0, n) * rng.choice([-1.0, 1.0], n),
        flux_mT=None if magnet else load,
        angle_deg=rng.uniform(20.0, 160.0, n),
        gap_mm=load if magnet else None,
        magnet=Magnet.cube(55.0, 1.305) if magnet else None,
    )


def one_by_one(designs: Designs, i: int):
    rod = Specimen(
        name="row",
        side_mm=designs.side_mm[i],
        remanence_mT=designs.remanence_mT[i],
        sections=tuple(
            Section(length_mm=h, E_MPa=E)
            for h, E in zip(designs.length_mm[i], designs.E_MPa[i], strict=True)
        ),
    )
    if designs.magnet is not None:
        return solve(rod, MagnetField(magnet=designs.magnet, gap_mm=designs.gap_mm[i]))
    field = UniformField(flux_mT=designs.flux_mT[i], angle_deg=designs.angle_deg[i])
    return solve(rod, field)


@pytest.mark.parametrize("magnet", [False, True])
def test_agrees_with_the_single_solver(magnet):
    designs = random_designs(60, magnet=magnet)
    found = solve_shapes(designs)
    for i in range(len(designs)):
        single = one_by_one(designs, i)
        assert STATUS[found.status[i]] == single.status
        if single.centreline is None:
            assert np.all(np.isnan(found.points[i]))
            continue
        line = single.centreline
        away = np.abs(found.points[i, :, 1:3] - line.points_mm).max()
        assert away <= found.error_mm[i] + 1e-9
        assert found.error_mm[i] < 1e-4
        np.testing.assert_allclose(found.points[i, :, 0], line.s_mm, atol=1e-12)
        np.testing.assert_allclose(found.points[i, :, 3], line.theta_rad, atol=1e-5)
        np.testing.assert_allclose(found.points[i, :, 4], line.kappa_per_mm, atol=1e-5)


def test_points_by_section_contain_the_joints():
    designs = random_designs(4, magnet=False)
    s_mm = solve_shapes(designs, points=31, by_section=True).points[:, :, 0]
    joints = np.cumsum(designs.length_mm, axis=1)
    np.testing.assert_allclose(s_mm[:, [10, 20, 30]], joints, atol=1e-12)
    with pytest.raises(InputError, match="multiple of 3"):
        solve_shapes(designs, points=30, by_section=True)


def test_the_paper_bench_pushes_and_pulls():
    tips = []
    for sign in (1.0, -1.0):
        base = designs_of(gmc(2), 1.0)
        design = Designs(
            length_mm=base.length_mm,
            E_MPa=base.E_MPa,
            side_mm=base.side_mm,
            remanence_mT=sign * base.remanence_mT,
            angle_deg=base.angle_deg,
            gap_mm=np.array([60.0]),
            magnet=Magnet.cube(55.0, 1.305),
        )
        tips.append(solve_shapes(design).points[0, -1, 2])
    assert tips == pytest.approx([4.14947950271, -5.60958586], abs=1e-5)


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("side_mm", [0.0], "above zero"),
        ("E_MPa", [[20.0, 15.0, np.nan]], "finite number in MPa"),
        ("flux_mT", [4e4], "30000 mT"),
        ("flux_mT", None, "either"),
        ("length_mm", [[1.0] * 3] * 2, "rows"),
    ],
)
def test_impossible_designs_are_refused(key, value, word):
    base = designs_of(gmc(2), 50.0)
    values = {name: getattr(base, name) for name in base.__dataclass_fields__}
    values[key] = None if value is None else np.array(value)
    with pytest.raises(InputError, match=word):
        Designs(**values)


def test_a_rod_of_two_sides_is_no_design():
    sections = (
        Section(length_mm=10.0, E_MPa=9.0),
        Section(length_mm=10.0, E_MPa=9.0, side_mm=2.0),
    )
    rod = Specimen(name="two", side_mm=1.0, remanence_mT=20.0, sections=sections)
    with pytest.raises(InputError, match="one side_mm"):
        designs_of(rod, 50.0)
