"""Batches: the same tips as one by one, bounded errors, progress, stop, bad input."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import MagnetField, UniformField, solve, solve_many
from magbend.sim.batch.threads import in_threads
from magbend.sim.batch.tips import CHUNK, OUTCOMES

CUBE = Magnet.cube(55.0, 1.305)
TABLE = {
    "length_mm": np.array([[10, 10, 10], [20, 5, 5], [5, 5, 20]], dtype=float),
    "E_MPa": np.array([[20, 15, 10], [16, 12, 8], [14, 10, 7.5]]),
}


def designs(n: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    kind = rng.integers(0, 3, n)
    return {
        "length_mm": TABLE["length_mm"][kind],
        "E_MPa": TABLE["E_MPa"][kind] * rng.uniform(0.5, 1.5, (n, 1)),
        "side_mm": rng.uniform(0.7, 1.3, n),
        "remanence_mT": rng.uniform(10.0, 30.0, n) * rng.choice([-1.0, 1.0], n),
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


@pytest.mark.parametrize("magnet", [None, CUBE], ids=["uniform", "cube"])
def test_agrees_with_one_by_one_within_its_error(magnet: Magnet | None) -> None:
    n = 400
    rng = np.random.default_rng(3)
    columns = designs(n, 2)
    if magnet is None:
        columns["flux_mT"] = rng.uniform(-150.0, 150.0, n)
        columns["angle_deg"] = rng.uniform(-180.0, 180.0, n)
    else:
        columns["gap_mm"] = rng.uniform(25.0, 120.0, n)
    found = solve_many(columns, magnet=magnet)
    for i in range(n):
        field = (
            UniformField(
                flux_mT=float(columns["flux_mT"][i]),
                angle_deg=float(columns["angle_deg"][i]),
            )
            if magnet is None
            else MagnetField(magnet=magnet, gap_mm=float(columns["gap_mm"][i]))
        )
        solution = solve(one(columns, i), field)
        assert OUTCOMES[found["outcome"][i]] == solution.status
        assert found["morse_index"][i] == solution.morse_index
        if solution.centreline is None:
            assert np.isnan(found["tip_x_mm"][i])
            continue
        x, y = solution.centreline.tip_mm
        miss = np.hypot(x - found["tip_x_mm"][i], y - found["tip_y_mm"][i])
        assert miss <= found["error_mm"][i] + solution.error_mm
        assert miss < 1e-5
        assert found["tip_angle_deg"][i] == pytest.approx(
            solution.centreline.tip_angle_deg, abs=1e-4
        )


@pytest.mark.parametrize("sections", [1, 4])
def test_before_near_magnets_too(sections: int) -> None:
    """Attraction, snapping, touching: every lane says what the single solver says."""
    rng = np.random.default_rng(sections)
    worst = 0.0
    for _ in range(6):
        n = 60
        columns = {
            "length_mm": rng.uniform(2.0, 20.0, (n, sections)),
            "E_MPa": 10.0 ** rng.uniform(0.3, 1.7, (n, sections)),
            "side_mm": rng.uniform(0.5, 1.5, n),
            "remanence_mT": rng.uniform(5.0, 60.0, n) * rng.choice([-1.0, 1.0], n),
            "gap_mm": rng.uniform(3.0, 60.0, n),
        }
        magnet = Magnet(
            sides_mm=(25.0, 30.0, 40.0),
            remanence_T=float(rng.choice([-1.2, 1.2])),
            axis_angle_deg=float(rng.uniform(-180.0, 180.0)),
            offset_mm=(float(rng.uniform(-20, 20)), float(rng.uniform(-20, 20)), 0.0),
        )
        found = solve_many(columns, magnet=magnet)
        for i in range(n):
            field = MagnetField(magnet=magnet, gap_mm=float(columns["gap_mm"][i]))
            try:
                solution = solve(one(columns, i), field)
            except InputError:
                assert OUTCOMES[found["outcome"][i]] == "touches the magnet"
                continue
            assert OUTCOMES[found["outcome"][i]] == solution.status
            if solution.centreline is not None:
                x, y = solution.centreline.tip_mm
                miss = np.hypot(x - found["tip_x_mm"][i], y - found["tip_y_mm"][i])
                worst = max(worst, miss / (found["error_mm"][i] + solution.error_mm))
    assert worst < 1.0


def test_structured_arrays_and_scalars() -> None:
    kind = np.dtype([("flux_mT", float), ("side_mm", float)])
    table = np.zeros(3, dtype=kind)
    table["flux_mT"] = [10.0, 20.0, 30.0]
    table["side_mm"] = 1.0
    by_name = {name: table[name] for name in table.dtype.names or ()}
    rest = {"length_mm": [10, 20], "E_MPa": [20, 10], "remanence_mT": 20.0}
    found = solve_many(by_name | rest)
    assert found.shape == (3,)
    assert np.all(np.diff(found["tip_y_mm"]) > 0.0)
    full = np.zeros(
        3,
        dtype=[
            ("flux_mT", float), ("side_mm", float), ("length_mm", float, 2),
            ("E_MPa", float, 2), ("remanence_mT", float),
        ],
    )  # fmt: skip
    for name, value in (by_name | rest).items():
        full[name] = value
    assert np.array_equal(solve_many(full), found)


def test_an_interrupt_leaves_the_chunks_that_wait() -> None:
    held, begun = threading.Event(), []

    def work(rows: slice) -> None:
        begun.append(rows)
        if rows.start > 0:
            held.wait(5.0)

    def interrupted(*_: int) -> None:
        threading.Timer(0.2, held.set).start()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        in_threads(work, 100, 1, threads=2, progress=interrupted)
    assert len(begun) < 10


def test_progress_and_stop() -> None:
    n = 2 * CHUNK + 5
    columns = {k: np.resize(v, (n, 3)) for k, v in TABLE.items()}
    columns |= {"side_mm": np.ones(n), "remanence_mT": np.full(n, 20.0)}
    columns["flux_mT"] = np.full(n, 50.0)
    told: list[tuple[int, int]] = []
    whole = solve_many(columns, progress=lambda a, b: told.append((a, b)), threads=2)
    assert told[-1] == (n, n)
    assert [a for a, _ in told] == sorted(a for a, _ in told)
    assert np.all(whole["outcome"] == 0)
    asked = iter([False, True, True])
    part = solve_many(columns, stop=lambda: next(asked), threads=1)
    assert np.all(part["outcome"][:CHUNK] == 0)
    assert np.all(part["outcome"][CHUNK:] == OUTCOMES.index("not solved"))
    assert np.all(np.isnan(part["tip_x_mm"][CHUNK:]))


def test_two_callers_at_once() -> None:
    columns = designs(3000, 9) | {"flux_mT": np.full(3000, 40.0)}
    alone = solve_many(columns)
    results: list[np.ndarray] = []
    threads = [
        threading.Thread(target=lambda: results.append(solve_many(columns)))
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(result, alone) for result in results)


def test_a_rod_through_the_magnet_is_told() -> None:
    found = solve_many(
        {"length_mm": [30.0], "E_MPa": [10.0], "side_mm": 1.0, "remanence_mT": 20.0,
         "gap_mm": [0.3, 60.0]},
        magnet=CUBE,
    )  # fmt: skip
    assert [OUTCOMES[k] for k in found["outcome"]] == ["touches the magnet", "stable"]


GOOD = {
    "length_mm": [10.0, 20.0],
    "E_MPa": [20.0, 10.0],
    "side_mm": 1.0,
    "remanence_mT": 20.0,
    "flux_mT": [50.0, 60.0],
}


@pytest.mark.parametrize(
    ("change", "pattern"),
    [
        ({"E_MPa": [20.0, -1.0]}, r"E_MPa.*MPa.*-1"),
        ({"length_mm": [0.0, 1.0]}, r"length_mm.*mm"),
        ({"side_mm": np.nan}, r"side_mm.*mm"),
        ({"flux_mT": [1e5, 1.0]}, r"flux_mT.*mT"),
        ({"flux_mT": [np.inf, 1.0]}, r"flux_mT.*mT"),
        ({"E_MPa": [20.0, 10.0, 5.0]}, r"E_MPa"),
        ({"angle_deg": [1.0, 2.0, 3.0]}, r"flux_mT|angle_deg"),
        ({"gap_mm": 50.0}, r"columns"),
    ],
)
def test_bad_designs_are_refused(change: dict[str, object], pattern: str) -> None:
    with pytest.raises(InputError, match=pattern):
        solve_many(GOOD | change)


def test_a_missing_column_is_named() -> None:
    with pytest.raises(InputError, match="E_MPa"):
        solve_many({k: v for k, v in GOOD.items() if k != "E_MPa"})
