"""Ratios, sums, several keys, fronts and SQL over a library, against numpy."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_library import write_space
from typer.testing import CliRunner

from magbend.analysis.library.build import build
from magbend.analysis.library.query import query
from magbend.analysis.library.space import read_space
from magbend.analysis.library.sql import ask
from magbend.cli.main import app
from magbend.core.errors import InputError

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("asking")
    build(read_space(write_space(folder, designs=1500)), folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def table(library):
    return query(library, top=1500).table.to_pandas()


def test_every_row_says_the_length_of_the_whole_rod(table):
    lengths = table[["length1_mm", "length2_mm", "length3_mm"]].sum(axis=1)
    assert np.allclose(table["total_length_mm"], lengths)


@pytest.mark.parametrize(
    ("text", "mask"),
    [
        ("E1_MPa / E3_MPa > 2", lambda t: t.E1_MPa / t.E3_MPa > 2),
        ("abs(tip_y_mm - 5) < 0.5", lambda t: abs(t.tip_y_mm - 5) < 0.5),
        (
            "length1_mm + length2_mm + length3_mm < 30",
            lambda t: t.length1_mm + t.length2_mm + t.length3_mm < 30,
        ),
        ("total_length_mm >= 40", lambda t: t.total_length_mm >= 40),
        ("total_length_mm == 30", lambda t: abs(t.total_length_mm - 30) < 1e-6),
        ("2 * (E1_MPa - E2_MPa) != 0", lambda t: abs(t.E1_MPa - t.E2_MPa) > 1e-6),
        ("-tip_y_mm < -5", lambda t: t.tip_y_mm > 5),
    ],
)
def test_expressions_are_those_of_numpy(library, table, text, mask):
    assert query(library, where=text).matched == int(mask(table).sum())


@pytest.mark.parametrize(
    "text",
    ["side_mm / 0 > 1", "side_mm ** 2 > 1", "abs(1, 2) > 1", "status + 'a' > 1",
     "max(side_mm) > 1", "abs(side_mm, 1) > 1", "__import__('os') > 1"],
)  # fmt: skip
def test_what_cannot_be_computed_is_refused(library, text):
    with pytest.raises(InputError):
        query(library, where=text)


def test_several_keys_decide_in_turn(library, table):
    keys = ["status", "-tip_y_mm"]
    with pytest.raises(InputError, match="no number"):
        query(library, sort=keys)
    found = query(library, sort=["design - design", "-E1_MPa/E3_MPa"], top=7)
    ratio = table.E1_MPa / table.E3_MPa
    assert found.table["design"].to_pylist() == list(
        table.design[np.argsort(-ratio, kind="stable")[:7]]
    )


def test_a_front_is_beaten_by_none(library, table):
    found = query(library, pareto=["side_mm", "-tip_y_mm"], top=1500)
    front = found.table.to_pandas()
    keys = np.column_stack([table.side_mm, -table.tip_y_mm])
    keys = keys[np.all(np.isfinite(keys), axis=1)]

    def beaten(row: np.ndarray) -> bool:
        no_worse = np.all(keys <= row, axis=1)
        return bool(np.any(no_worse & np.any(keys < row, axis=1)))

    taken = np.column_stack([front.side_mm, -front.tip_y_mm])
    assert not any(beaten(row) for row in taken)
    assert len(taken) == sum(not beaten(row) for row in keys)
    assert np.all(np.diff(front.side_mm) >= 0.0)
    with pytest.raises(InputError, match="two keys or more"):
        query(library, pareto=["side_mm"])


def test_sql_answers_as_numpy_does(library, table):
    rows = ask(
        library,
        "SELECT round(total_length_mm / 10) AS decade, count(*) AS n, "
        "max(tip_y_mm) AS most FROM designs GROUP BY decade ORDER BY decade",
    ).to_pylist()
    decade = np.floor(table.total_length_mm / 10 + 0.5)
    for row in rows:
        here = table[decade == row["decade"]]
        assert row["n"] == len(here)
        assert row["most"] == pytest.approx(here.tip_y_mm.max())
    assert sum(row["n"] for row in rows) == len(table)
    assert ask(library, "SELECT * FROM designs", top=3).num_rows == 3


@pytest.mark.parametrize(
    "sql",
    [
        "DROP VIEW designs",
        "SELECT 1; SELECT 2",
        "COPY designs TO 'stolen.csv'",
        "SELECT * FROM 'other.parquet'",
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT nothing FROM designs",
        "SET enable_external_access = true",
        "",
    ],
)
def test_sql_reads_the_library_and_nothing_else(library, sql, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="--sql"):
        ask(library, sql)
    assert not list(tmp_path.iterdir())


def test_the_command_asks_in_sql(library: Path):
    sql = "SELECT design, total_length_mm FROM designs ORDER BY design LIMIT 2"
    done = CliRunner().invoke(
        app, ["analysis", "library", "query", str(library), "--sql", sql, "--json"]
    )
    assert done.exit_code == 0
    assert [row["design"] for row in json.loads(done.stdout)] == [0, 1]
