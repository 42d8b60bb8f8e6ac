"""The library: spaces, builds that survive, queries against numpy."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from magbend.analysis.compare.metrics import circularity, fit_circle, quadratic_fit
from magbend.analysis.library import space as space_module
from magbend.analysis.library.build import (
    MANIFEST,
    build,
    partition_count,
    partition_path,
    read_manifest,
)
from magbend.analysis.library.ledger import Ledger
from magbend.analysis.library.query import query, write_rows
from magbend.analysis.library.space import Space, read_space
from magbend.analysis.shapes.feasible import falling_moduli, fitting_lengths
from magbend.cli.main import app
from magbend.core.errors import ConfigError, InputError, StoreError
from magbend.core.owned import MARK
from magbend.core.specimen import Section, Specimen
from magbend.sim import UniformField, gmc, solve

pa = pytest.importorskip("pyarrow")
FIXTURE = Path(__file__).parents[2] / "fixtures" / "library" / "million.toml"

SPACE = """
name = "small"
method = "sobol"
designs = {designs}
partition_rows = 1024
side_mm = {{ from = 0.75, to = 1.35 }}
remanence_mT = {{ from = 14.0, to = 26.0 }}
flux_mT = {{ from = 10.0, to = 120.0 }}
"""
SECTION = """
[[section]]
length_mm = { from = 5.0, to = 20.0 }
E_MPa = { from = 6.0, to = 48.0 }
"""


def write_space(folder: Path, designs: int = 3000) -> Path:
    path = folder / "space.toml"
    path.write_text(SPACE.format(designs=designs) + 3 * SECTION)
    return path


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    space = read_space(write_space(folder))
    build(space, folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def table(library):
    return query(library, top=3000).table.to_pandas()


# spaces


def test_the_fixture_holds_exactly_a_million():
    space = read_space(FIXTURE)
    assert space.size == 1_000_000
    some = space.rows(999_000, 1_000_000)
    assert np.all(np.diff(some.E_MPa, axis=1) <= 0.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2900), st.integers(1, 100))
def test_any_part_of_a_space_is_the_same_designs(start, count):
    data = {"from": 5.0, "to": 20.0}
    space = Space.model_validate(
        {
            "name": "s",
            "method": "sobol",
            "designs": 3000,
            "side_mm": 1.0,
            "remanence_mT": 20.0,
            "flux_mT": {"from": 10.0, "to": 120.0},
            "total_length_mm": 30.0,
            "section": [{"length_mm": data, "E_MPa": {"from": 6.0, "to": 48.0}}] * 3,
        }
    )
    whole, part = space.rows(0, 3000), space.rows(start, start + count)
    np.testing.assert_array_equal(whole.E_MPa[start : start + count], part.E_MPa)
    np.testing.assert_array_equal(whole.flux_mT[start : start + count], part.flux_mT)
    np.testing.assert_allclose(part.length_mm.sum(axis=1), 30.0, atol=1e-9)


units = st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3)


@given(units, units)
def test_the_maps_never_leave_what_can_be_made(u, v):
    low, high = np.array([8.0, 6.0, 7.0]), np.array([50.0, 30.0, 48.0])
    E = falling_moduli(np.array([u]), low, high)[0]
    assert np.all(np.diff(E) <= 0.0)
    assert np.all((low <= E) & (high >= E))
    low, high = np.array([5.0, 2.0, 5.0]), np.array([20.0, 8.0, 20.0])
    lengths = fitting_lengths(np.array([v[:2]]), low, high, np.array([30.0]))[0]
    assert lengths.sum() == pytest.approx(30.0, abs=1e-12)
    assert np.all((lengths >= low - 1e-9) & (lengths <= high + 1e-9))


GRID = {
    "name": "g",
    "side_mm": [1.0],
    "remanence_mT": [20.0],
    "flux_mT": [50.0],
    "section": [{"length_mm": [10.0], "E_MPa": [20.0, 10.0]}] * 3,
}


def toml_of(data: dict) -> str:
    return json.dumps(data)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"side_mm": []}, "at least one value"),
        ({"side_mm": {"from": 2.0, "to": 1.0, "count": 3}}, "must rise"),
        ({"side_mm": {"from": 1.0, "to": 2.0}}, "must have a count"),
        ({"side_mm": -1.0}, "above zero"),
        ({"side_mm": {"from": 1.0, "to": 2.0, "count": 10**12}}, "at most 1000000"),
        ({"flux_mT": [50.0, -1e5]}, "within 30000 mT"),
        ({"sides_mm": [1.0]}, "did you mean 'side_mm'"),
        ({"flux_mT": None, "gap_mm": [60.0]}, "belong together"),
        ({"gap_mm": [60.0]}, "either flux_mT"),
        ({"total_length_mm": 90.0}, "do not add up"),
        ({"total_length_mm": 30.5}, "do not add up"),
        ({"designs": 5}, "grid has its own"),
        ({"method": "sobol"}, "how many designs"),
        ({"method": "random"}, "'grid' or 'sobol'"),
        (
            {
                "section": [
                    {"length_mm": 10.0, "E_MPa": 10.0},
                    {"length_mm": 10.0, "E_MPa": 20.0},
                ]
            },
            "must fall from root to tip",
        ),
        ({"section": []}, "section"),
    ],
)
def test_contradictory_spaces_are_one_sentence(tmp_path, change, sentence):
    data = {k: v for k, v in (GRID | change).items() if v is not None}
    path = tmp_path / "space.toml"
    path.write_text(toml_of(data))
    with pytest.raises(ConfigError, match=sentence) as error:
        read_space(path)
    assert "\n" not in str(error.value)


# builds


def test_rows_are_what_the_solver_and_the_metrics_say(table):
    for row in table.iloc[:: len(table) // 12].to_dict("records"):
        rod = Specimen(
            name="row",
            side_mm=row["side_mm"],
            remanence_mT=row["remanence_mT"],
            sections=tuple(
                Section(length_mm=row[f"length{i}_mm"], E_MPa=row[f"E{i}_MPa"])
                for i in (1, 2, 3)
            ),
        )
        line = solve(rod, UniformField(flux_mT=row["flux_mT"])).centreline
        assert (row["tip_x_mm"], row["tip_y_mm"]) == pytest.approx(
            line.tip_mm, rel=2e-6, abs=2e-5
        )
        circle = fit_circle(line.points_mm)
        assert row["radius_mm"] == pytest.approx(circle.radius_mm, rel=2e-5)
        round_ = circularity(line.s_mm, line.kappa_per_mm)
        assert row["circularity"] == pytest.approx(round_, rel=1e-5)
        a_per_mm, misfit_mm = quadratic_fit(line.points_mm)
        assert row["a_per_mm"] == pytest.approx(a_per_mm, rel=1e-5)
        assert row["a_misfit_mm"] == pytest.approx(misfit_mm, rel=1e-3, abs=1e-6)
        assert row["y50_mm"] == pytest.approx(line.y_mm[30], rel=1e-5, abs=1e-5)
        assert row["status"] == "stable"


def test_a_finished_build_repeats_nothing(library):
    space = read_space(library.parent / "space.toml")
    before = {p.name: p.stat().st_mtime_ns for p in library.glob("*.*")}
    summary = build(space, library)
    assert summary.solved_partitions == 0
    after = {p.name: p.stat().st_mtime_ns for p in library.glob("*.*")}
    assert {name: after[name] for name in before if name != MARK} == {
        name: time for name, time in before.items() if name != MARK
    }


def test_a_damaged_partition_is_solved_again(tmp_path):
    space = read_space(write_space(tmp_path))
    out = tmp_path / "out"
    build(space, out)
    victim = partition_path(out, 1)
    good = victim.read_bytes()
    victim.write_bytes(good[: len(good) // 2])
    with pytest.raises(StoreError, match=r"part-000001\.parquet damaged; delete it"):
        query(out, where="tip_y_mm > 1")
    summary = build(space, out)
    assert summary.repaired == (victim.name,)
    assert summary.solved_partitions == 1
    assert query(out, where="tip_y_mm > -1").matched == 3000


def test_a_flipped_byte_is_noticed(tmp_path):
    space = read_space(write_space(tmp_path, designs=1024))
    build(space, tmp_path / "out")
    victim = partition_path(tmp_path / "out", 0)
    content = bytearray(victim.read_bytes())
    content[len(content) // 3] ^= 0xFF
    victim.write_bytes(content)
    with pytest.raises(StoreError, match="part-000000"):
        query(tmp_path / "out", top=1000)


def test_a_bit_anywhere_of_a_partition_is_noticed_and_it_is_solved_again(tmp_path):
    space = read_space(write_space(tmp_path, designs=2048))
    out = tmp_path / "out"
    build(space, out)
    generator = np.random.default_rng(3)
    for turn in range(6):
        victim = partition_path(out, turn % 2)
        good = victim.read_bytes()
        flipped = bytearray(good)
        flipped[int(generator.integers(len(good)))] ^= 1 << int(generator.integers(8))
        victim.write_bytes(flipped)
        summary = build(space, out)
        assert summary.repaired == (victim.name,)
        assert victim.read_bytes() == good


def test_a_partition_of_another_space_is_not_taken(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first = read_space(write_space(tmp_path / "a", designs=1024))
    path = write_space(tmp_path / "b", designs=1024)
    path.write_text(path.read_text().replace('name = "', 'name = "other '))
    second = read_space(path)
    build(first, tmp_path / "one")
    build(second, tmp_path / "two")
    foreign = partition_path(tmp_path / "two", 0).read_bytes()
    victim = partition_path(tmp_path / "one", 0)
    good = victim.read_bytes()
    victim.write_bytes(foreign)
    with pytest.raises(StoreError, match=r"part-000000\.parquet is of another space"):
        query(tmp_path / "one", where="tip_y_mm > -1")
    for ledger in (True, False):
        victim.write_bytes(foreign)
        if not ledger:
            (tmp_path / "one" / "_digests.jsonl").unlink()
        assert build(first, tmp_path / "one").repaired == (victim.name,)
        assert victim.read_bytes() == good


def test_a_partition_too_many_is_named_and_nothing_counts_below_zero(tmp_path):
    space = read_space(write_space(tmp_path, designs=1024))
    build(space, tmp_path / "out")
    extra = partition_path(tmp_path / "out", 7)
    extra.write_bytes(partition_path(tmp_path / "out", 0).read_bytes())
    for act in (
        lambda: build(space, tmp_path / "out"),
        lambda: query(tmp_path / "out"),
    ):
        with pytest.raises(StoreError, match=r"part-000007\.parquet, which is no part"):
            act()


def test_partitions_of_before_the_ledger_are_read_whole_and_kept(tmp_path):
    space = read_space(write_space(tmp_path, designs=2048))
    out = tmp_path / "out"
    build(space, out)
    (out / "_digests.jsonl").unlink()
    assert build(space, out).solved_partitions == 0
    assert len(Ledger.read(out).digests) == 2


def test_a_second_builder_is_told_who_builds(tmp_path):
    space = read_space(write_space(tmp_path, designs=1024))
    told = []

    def other():
        with pytest.raises(StoreError) as caught:
            build(space, tmp_path / "out")
        told.append(str(caught.value))

    def progress(_done, _total):
        if not told:
            thread = threading.Thread(target=other)
            thread.start()
            thread.join()

    build(space, tmp_path / "out", progress=progress)
    assert "is being written by magbend analysis library build, process" in told[0]


@pytest.mark.parametrize(
    "change",
    [
        {"schema": 99}, {"schema": "1"}, {"designs": -3}, {"partitions": 0},
        {"space": {}}, {"space": None}, {"digest": "0" * 64}, {"designs": None},
    ],
)  # fmt: skip
def test_a_manifest_of_another_kind_is_a_sentence(change, library, tmp_path):
    data = json.loads((library / MANIFEST).read_text())
    (tmp_path / MANIFEST).write_text(json.dumps({**data, **change}))
    with pytest.raises(StoreError, match=r"damaged|newer magbend"):
        read_manifest(tmp_path)


def test_another_space_or_folder_is_not_overwritten(library, tmp_path):
    other = read_space(write_space(tmp_path, designs=2000))
    with pytest.raises(StoreError, match="another space"):
        build(other, library)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("keep")
    with pytest.raises(StoreError, match="was not made by magbend"):
        build(other, tmp_path / "notes")


def test_a_killed_build_goes_on_where_it_stopped(tmp_path):
    path = write_space(tmp_path, designs=400_000)
    text = path.read_text().replace("= 1024", "= 8192")
    path.write_text(text)
    out = tmp_path / "out"
    code = f"""
import sys
from pathlib import Path
from magbend.analysis.library.build import build
from magbend.analysis.library.space import read_space
build(read_space(Path({str(path)!r})), Path({str(out)!r}))
"""
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        deadline = time.monotonic() + 120.0
        while len(list(out.glob("part-*.parquet"))) < 2:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    finished = {p.name: p.stat().st_mtime_ns for p in out.glob("part-*.parquet")}
    space = read_space(path)
    assert 2 <= len(finished) < partition_count(space)
    found = query(out, top=1)
    assert found.missing_partitions == partition_count(space) - len(finished)
    told = []

    def stop_after_two(done: int, total: int) -> None:
        told.append(done)
        if len(told) > 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build(space, out, progress=stop_after_two)
    assert told[0] == 8192 * len(finished)
    after = {p.name: p.stat().st_mtime_ns for p in out.glob("part-*.parquet")}
    assert len(after) > len(finished)
    assert all(after[name] == when for name, when in finished.items())
    assert not list(out.glob(".part-*.tmp"))


def test_the_folder_explains_itself(library):
    manifest = read_manifest(library)
    assert manifest["designs"] == 3000
    assert manifest["partitions"] == 3
    assert {"magbend", "numpy", "pyarrow"} <= set(manifest["versions"])
    again = Space.model_validate(manifest["space"])
    assert again.size == 3000


# queries


@pytest.mark.parametrize(
    ("where", "pick"),
    [
        ("tip_y_mm > 4 and side_mm < 1", lambda t: (t.tip_y_mm > 4) & (t.side_mm < 1)),
        (
            "10 < radius_mm <= 50 or not circularity >= 0.8",
            lambda t: (
                ((t.radius_mm > 10) & (t.radius_mm <= 50)) | (t.circularity < 0.8)
            ),
        ),
        ("status == 'stable' and flux_mT >= 100", lambda t: t.flux_mT >= 100),
        ("tip_y_mm > -1", lambda t: t.tip_y_mm > -1),
    ],
)
def test_conditions_mean_what_they_say(library, table, where, pick):
    found = query(library, where=where, top=3000)
    wanted = table[pick(table)]
    assert found.matched == len(wanted)
    assert set(found.table.column("design").to_pylist()) == set(wanted.design)


@pytest.mark.parametrize("falling", [False, True])
def test_sorting_keeps_the_best(library, table, falling):
    found = query(
        library,
        ranges=["radius_mm=:100"],
        sort=("-" if falling else "") + "circularity",
        top=7,
    )
    near = table[table.radius_mm <= 100]
    wanted = near.sort_values("circularity", ascending=not falling).head(7)
    assert found.table.column("design").to_pylist() == wanted.design.tolist()
    assert found.matched == len(near)


def test_the_nearest_shape_is_the_one_asked_for(library, table):
    row = table.iloc[1234]
    rod = Specimen(
        name="row",
        side_mm=row.side_mm,
        remanence_mT=row.remanence_mT,
        sections=tuple(
            Section(length_mm=row[f"length{i}_mm"], E_MPa=row[f"E{i}_MPa"])
            for i in (1, 2, 3)
        ),
    )
    line = solve(rod, UniformField(flux_mT=row.flux_mT)).centreline
    found = query(library, nearest=line, top=5).table
    assert found.column("design").to_pylist()[0] == row.design
    distances = found.column("distance_mm").to_pylist()
    assert distances[0] < 1e-4
    assert distances == sorted(distances)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"where": "tip_ymm > 4"}, "did you mean 'tip_y_mm'"),
        ({"where": "__import__('os')"}, "cannot use"),
        ({"where": f"tip_y_mm + 1{'0' * 400} > 1"}, "cannot use"),
        ({"where": "tip_y_mm >"}, "must be a condition"),
        ({"where": "1 < 2"}, "compares no column"),
        ({"where": "status > 4"}, "unlike things"),
        ({"ranges": ["tip_y_mm=5:4"]}, "LOW not above HIGH"),
        ({"ranges": ["tip_y_mm"]}, "KEY=LOW:HIGH"),
        ({"sort": "status"}, "no number"),
        ({"sort": "nothing"}, "no column"),
        ({"top": 0}, "--top"),
    ],
)
def test_wrong_queries_are_one_sentence(library, wrong, sentence):
    with pytest.raises(InputError, match=sentence) as error:
        query(library, **wrong)
    assert "\n" not in str(error.value)


def test_one_ranking_at_a_time(library):
    line = solve(gmc(2), UniformField(flux_mT=9.0)).centreline
    with pytest.raises(InputError, match="not several"):
        query(library, sort="a_per_mm", nearest=line)


def test_rows_go_to_csv_and_parquet(library, tmp_path):
    found = query(library, sort="radius_mm", top=4)
    write_rows(found, tmp_path / "best.csv")
    lines = (tmp_path / "best.csv").read_text().splitlines()
    assert len(lines) == 5
    assert "radius_mm" in lines[0].replace('"', "").split(",")
    write_rows(found, tmp_path / "best.parquet")
    import pyarrow.parquet as pq

    assert pq.read_table(tmp_path / "best.parquet").num_rows == 4
    with pytest.raises(InputError, match=r"\.csv or \.parquet"):
        write_rows(found, tmp_path / "best.xlsx")


def test_commands(tmp_path):
    runner = CliRunner()
    space, out = write_space(tmp_path, designs=1500), tmp_path / "out"
    asked = ["analysis", "library", "build", str(space), "--out", str(out), "--json"]
    done = json.loads(runner.invoke(app, asked).stdout)
    assert done == {
        "designs": 1500, "partitions": 2, "solved_partitions": 2, "repaired": [],
    }  # fmt: skip
    result = runner.invoke(
        app,
        ["analysis", "library", "query", str(out), "--sort=-tip_y_mm", "--top", "3"],
    )
    assert "1500 of 1500 designs match" in result.stdout
    assert len(result.stdout.splitlines()) == 5
    missing = runner.invoke(app, ["analysis", "library", "query", str(tmp_path)])
    assert isinstance(missing.exception, StoreError)


def test_without_pyarrow_the_extra_is_named(tmp_path, monkeypatch):
    from magbend.core.errors import MissingExtraError

    space = read_space(write_space(tmp_path))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"\.\[library\]"):
        build(space, tmp_path / "out")


def test_a_sobol_sequence_begins_once_for_a_block_of_its_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept, begun = space_module.sobol_points, []

    def counted(*asked: int) -> np.ndarray:
        begun.append(asked)
        return kept(*asked)

    monkeypatch.setattr(space_module, "sobol_points", counted)
    end = space_module.BLOCK
    for start in range(end - 2000, end + 2000, 500):
        points = space_module.points_of_blocks(5, start, start + 600, 987)
        assert np.array_equal(points, kept(5, start, start + 600, 987))
    assert len(begun) == 2
