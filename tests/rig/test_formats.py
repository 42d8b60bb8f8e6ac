"""Runs of every format stay readable; newer ones are refused; older ones migrate."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from magbend.analysis import load_run
from magbend.core.derived import read_manifest
from magbend.core.errors import StoreError
from magbend.core.owned import MARK
from magbend.rig import check_run, migrate_run, read_run, verify_run
from magbend.rig.runs import migrate
from magbend.rig.runs.folder import RunFolder
from magbend.rig.runs.records import SCHEMA

RUNS = Path(__file__).parents[2] / "fixtures" / "runs"


@pytest.fixture(params=["format_1_finished", "format_1_cut_off"])
def old(request, tmp_path) -> Path:
    path = tmp_path / request.param
    shutil.copytree(RUNS / request.param, path)
    return path


def test_a_run_of_format_1_is_read_and_verified_as_it_always_was(old):
    run = read_run(old)
    assert run.schema == 1
    assert [step["gap_mm"] for step in run.steps] == [70.0, 60.0, 50.0][
        : len(run.steps)
    ]
    assert run.status == ("success" if "finished" in old.name else "cut off")
    assert verify_run(old) == []
    (old / "images" / "step_001.png").write_bytes(b"other")
    assert verify_run(old) == ["images/step_001.png: altered (its SHA-256 differs)"]


def test_a_measured_run_of_format_1_is_loaded():
    data = load_run(RUNS / "format_1_finished")
    assert [frame.status for frame in data.frames.values()] == ["ok"] * 3
    assert data.specimen.length_mm == 30.0
    assert data.calibration is not None


@pytest.mark.parametrize("schema", [SCHEMA + 1, 99, 0, -1, "1", 1.0, True, None])
def test_another_format_is_refused_with_a_sentence(old, schema):
    record = json.loads((old / "run.json").read_text())
    (old / "run.json").write_text(json.dumps({**record, "schema": schema}))
    newer = type(schema) is int and schema > SCHEMA
    why = "newer magbend" if newer else "names no format"
    with pytest.raises(StoreError, match=why):
        read_run(old)
    assert why in verify_run(old)[0]
    with pytest.raises(StoreError, match=why):
        load_run(old)


def test_migration_keeps_the_record_and_accounts_for_every_file(old):
    before = {p.name: p.read_bytes() for p in old.iterdir() if p.is_file()}
    steps = [dict(step) for step in read_run(old).steps]
    assert "run.json" in migrate_run(old)
    check = check_run(old)
    assert check.problems == ()
    assert check.run is not None
    assert check.run.schema == SCHEMA
    for old_step, step in zip(steps, check.run.steps, strict=True):
        assert {name: step[name] for name in old_step} == old_step
    kept = old / MARK / "format_1"
    for path in kept.iterdir():
        assert path.read_bytes() == before[path.name]
    if "finished" in old.name:
        assert set(read_manifest(old)) == {
            "calibration.json", "centrelines.csv", "comparison.csv", "extract.json",
            "frames.csv",
        }  # fmt: skip
        load_run(old)
    else:
        RunFolder.reopen(old)
    assert migrate_run(old) == []
    data = (kept / "steps.jsonl").read_bytes()
    (kept / "steps.jsonl").write_bytes(data[:-1])
    assert f"{MARK}/format_1/steps.jsonl: altered" in verify_run(old)[0]


def test_a_run_that_does_not_hold_is_not_migrated(old):
    (old / "images" / "step_000.png").write_bytes(b"other")
    before = (old / "run.json").read_bytes()
    with pytest.raises(StoreError, match=r"does not hold.*step_000\.png: altered"):
        migrate_run(old)
    assert (old / "run.json").read_bytes() == before


@pytest.mark.parametrize("at", range(1, 7))
def test_a_migration_that_is_cut_off_is_taken_up_again(old, at, monkeypatch):
    plain, calls = migrate.write_text, []

    def die(path, text):
        calls.append(path)
        if len(calls) == at:
            raise KeyboardInterrupt
        plain(path, text)

    with monkeypatch.context() as patch:
        patch.setattr(migrate, "write_text", die)
        try:
            migrate_run(old)
        except KeyboardInterrupt:
            read_run(old)  # still a run, of either format
    migrate_run(old)
    assert verify_run(old) == []


def test_a_run_of_format_1_says_how_it_can_be_resumed():
    with pytest.raises(StoreError, match="magbend migrate"):
        RunFolder.reopen(RUNS / "format_1_cut_off")
