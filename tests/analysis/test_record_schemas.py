"""The shipped schemas say what runs, steps and comparisons hold."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest

from magbend.analysis.compare.compare import COLUMNS, EXTRA_COLUMNS
from magbend.analysis.schemas import RECORDS, toml_schema
from magbend.rig import migrate_run

RUNS = Path(__file__).parents[2] / "fixtures" / "runs"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "run"
    shutil.copytree(RUNS / "format_1_finished", path)
    migrate_run(path)
    return path


@pytest.mark.parametrize("kind", RECORDS)
def test_every_record_has_a_schema_that_says_what_must_be_there(kind):
    schema = toml_schema(kind)
    assert schema["$schema"].endswith("2020-12/schema")
    assert set(schema["required"]) <= set(schema["properties"])


def test_runs_and_steps_are_as_their_schemas_say(run):
    records = [("run", json.loads((run / "run.json").read_text()))]
    for line in (run / "steps.jsonl").read_text().splitlines():
        records.append(("step", json.loads(line)))
    for kind, record in records:
        schema = toml_schema(kind)
        assert set(schema["required"]) <= set(record)
        assert set(record) <= set(schema["properties"])


def test_the_columns_of_a_comparison_are_those_of_its_schema():
    assert list(toml_schema("comparison")["properties"]) == [*COLUMNS, *EXTRA_COLUMNS]
    with (RUNS / "format_1_finished" / "comparison.csv").open(newline="") as file:
        heads = next(csv.reader(file))
    assert set(toml_schema("comparison")["required"]) <= set(heads)
