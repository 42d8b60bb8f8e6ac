"""Batches before sums of sources: patches that bound their error, and run in lanes."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.specimen import Section, Specimen
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Dipole,
    Field,
    Gradient,
    Uniform,
    solve,
    solve_many,
)
from magbend.sim.batch import patches, tips

CUBE = Cuboid(sides_mm=55.0, remanence_T=1.305)
BESIDE = Cuboid(
    sides_mm=(20.0, 20.0, 30.0),
    remanence_T=-1.2,
    centre_mm=(-10.0, 70.0, 0.0),
    axis_angle_deg=-60.0,
)
CYLINDER = Cylinder(
    diameter_mm=40.0,
    length_mm=30.0,
    remanence_T=1.3,
    centre_mm=(90.0, 40.0, 0.0),
    axis_angle_deg=180.0,
)
COIL = Coil(diameter_mm=80.0, current_A=5.0, turns=200, centre_mm=(-60.0, -40.0, 0.0))
SMOOTH = Gradient(gradient_mT_per_mm=((0.2, 0.1, 0), (0.1, -0.1, 0), (0, 0, -0.1)))
FIELDS = [
    Field(CUBE, BESIDE, CYLINDER, COIL),
    Field(CUBE, Uniform(flux_mT=-5.0, angle_deg=20.0), SMOOTH),
    Field(Cylinder(diameter_mm=30.0, length_mm=20.0, remanence_T=1.3), COIL),
    Field(Dipole(diameter_mm=30.0, remanence_T=1.2), BESIDE),
    Field(Uniform(flux_mT=40.0, angle_deg=70.0), SMOOTH),
]
NAMES = ["four bodies", "smooth besides", "cylinder", "dipole", "no body"]
ENOUGH = patches.LEAST * patches.SHARE


def designs(n: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "length_mm": rng.uniform(6.0, 12.0, (n, 3)),
        "E_MPa": rng.uniform(6.0, 40.0, (n, 3)),
        "side_mm": rng.uniform(0.7, 1.3, n),
        "remanence_mT": rng.uniform(10.0, 30.0, n) * rng.choice([-1.0, 1.0], n),
        "gap_mm": rng.uniform(45.0, 100.0, n),
    }


def one(columns: dict[str, np.ndarray], i: int) -> Specimen:
    return Specimen(
        name="one",
        side_mm=float(columns["side_mm"][i]),
        remanence_mT=float(columns["remanence_mT"][i]),
        sections=tuple(
            Section(length_mm=float(a), E_MPa=float(b))
            for a, b in zip(columns["length_mm"][i], columns["E_MPa"][i], strict=True)
        ),
    )


@pytest.mark.parametrize("field", FIELDS, ids=NAMES)
def test_sums_run_in_lanes_and_end_where_single_rods_do(
    field: Field, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, alone = tips._solve_hard, []

    def counted(rods: np.ndarray, *rest: object) -> object:
        alone.append(len(rods))
        return kept(rods, *rest)

    monkeypatch.setattr(tips, "_solve_hard", counted)
    columns = designs(ENOUGH, 31)
    if not field.follows_gap:
        del columns["gap_mm"]
    found = solve_many(columns, magnet=field)
    assert sum(alone) < 0.02 * ENOUGH
    assert np.nanquantile(found["error_mm"], 0.99) < 1e-5
    for i in range(0, ENOUGH, ENOUGH // 40):
        there = field
        if field.follows_gap:
            there = field.at_gap(float(columns["gap_mm"][i]))
        solution = solve(one(columns, i), there)
        assert tips.OUTCOMES[found["outcome"][i]] == solution.status
        if solution.centreline is None:
            continue
        x, y = solution.centreline.tip_mm
        miss = np.hypot(x - found["tip_x_mm"][i], y - found["tip_y_mm"][i])
        assert miss <= found["error_mm"][i] + solution.error_mm


@pytest.mark.parametrize("field", FIELDS[:4], ids=NAMES[:4])
@pytest.mark.parametrize("side_mm", [3.0, 8.0])
def test_a_patch_is_within_its_bound_everywhere(field: Field, side_mm: float) -> None:
    numbers = patches.before_rods(
        field, np.full(2, 30.0), np.array([60.0, 60.0])
    ).numbers
    source = patches._sources(numbers)[0]
    low, counts = np.array([-5.0, -25.0]), (6, 7)
    fitted = patches._fitted(source, low, side_mm, counts)
    steps = np.linspace(-1.0, 1.0, 9)
    rows = patches._rows(steps)[: 2 * len(steps) ** 2]
    usable = 0
    for k, patch in enumerate(fitted):
        if patch[0] == np.inf:
            continue
        usable += 1
        place = low + side_mm * np.array([k // counts[1], k % counts[1]])
        x, y = place[:, None] + side_mm * (steps + 1.0) / 2.0
        truth = patches._table(source, x, y)[0][..., :2]
        given = (rows @ patch[1:]).reshape(2, len(steps), len(steps)) * 2.0 / side_mm
        miss = np.hypot(*(given - truth.transpose(2, 0, 1)))
        assert miss.max() <= patch[0]
    assert usable > 20


def test_few_designs_ask_the_sources_themselves() -> None:
    columns = designs(ENOUGH, 32)
    few = {name: values[:300] for name, values in columns.items()}
    field = FIELDS[0]
    many, alone = (solve_many(c, magnet=field)[:300] for c in (columns, few))
    assert np.array_equal(many["outcome"], alone["outcome"])
    miss = np.hypot(
        many["tip_x_mm"] - alone["tip_x_mm"], many["tip_y_mm"] - alone["tip_y_mm"]
    )
    assert np.nanmax(miss) < 1e-7
    assert np.all(miss <= many["error_mm"] + alone["error_mm"])


def test_a_compressed_rod_bends_to_the_side_of_its_branch() -> None:
    """Lanes once found the stable shape that it buckles to on the other side."""
    field = Field(
        Dipole(
            axis_angle_deg=-3.8325560592728607,
            centre_mm=(-35.759161096015816, -65.5362946436747, 0.0),
            remanence_T=-0.4056575625861474,
            diameter_mm=11.807394755592732,
        ),
        Uniform(flux_mT=13.235085688344213, angle_deg=-156.11143498503597),
        Cylinder(
            axis_angle_deg=-90.0,
            diameter_mm=33.37049871937978,
            length_mm=48.55947990685865,
            remanence_T=0.7537523694415764,
        ),
        Uniform(flux_mT=8.736112966714458, angle_deg=-35.561577137062585),
    )
    columns = {
        "length_mm": np.array([[25.027529684605295, 23.529198796508947]]),
        "E_MPa": np.array([[4.701502964775071, 2.2039959612518536]]),
        "side_mm": np.array([1.0172306437538448]),
        "remanence_mT": np.array([20.613713922763814]),
        "gap_mm": np.array([33.474413625046616]),
    }
    tip = solve_many(columns, magnet=field)[0]
    solution = solve(one(columns, 0), field.at_gap(33.474413625046616))
    assert solution.centreline is not None
    assert tip["tip_y_mm"] == pytest.approx(solution.centreline.tip_mm[1], abs=1e-5)
    assert tip["tip_y_mm"] < 0.0


def test_a_rod_that_flees_its_magnet_is_not_found_at_it() -> None:
    """Where flux falls off, a first guess from its gradient let it turn round."""
    magnet = Cuboid(sides_mm=(40.0, 18.0, 52.0), remanence_T=-0.75)
    columns = {
        "length_mm": np.array([[14.84, 14.84, 14.84]] * 3),
        "E_MPa": np.array([[3.0] * 3, [6.0] * 3, [12.0] * 3]),
        "side_mm": np.full(3, 0.9),
        "remanence_mT": np.full(3, -50.0),
        "gap_mm": np.array([24.0, 27.0, 31.0]),
    }
    found = solve_many(columns, magnet=Field(magnet))
    for i, gap_mm in enumerate(columns["gap_mm"]):
        solution = solve(one(columns, i), Field(magnet).at_gap(float(gap_mm)))
        assert solution.centreline is not None
        y = solution.centreline.tip_mm[1]
        assert y > 0.0
        assert found["tip_y_mm"][i] == pytest.approx(y, abs=1e-4)


def test_the_one_design_whose_sources_overlap_is_found() -> None:
    columns = designs(500, 33)
    field = Field(
        CUBE, Dipole(diameter_mm=10.0, remanence_T=1.0, centre_mm=(28.0, -20.0, 0.0))
    )
    columns["length_mm"][:] = 10.0
    columns["gap_mm"][:] = 40.0
    assert np.all(solve_many(columns, magnet=field)["outcome"] != 3)
    columns["gap_mm"][321] = 16.0
    with pytest.raises(InputError, match=r"sources 0 \(cuboid\) and 1 \(dipole\)"):
        solve_many(columns, magnet=field)
