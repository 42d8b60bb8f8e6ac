"""A run in other people's formats says the same as the run folder."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import StoreError
from magbend.rig.runs.documents import documents_of, write_documents
from magbend.rig.runs.nexus import write_nexus
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run


@pytest.fixture
def done(make_bench, tmp_path):
    bench = make_bench()
    assert run(bench.plan, bench.devices, tmp_path / "run").status == "success"
    return read_run(tmp_path / "run")


def test_documents_are_those_of_the_event_model(done, tmp_path):
    count = write_documents(done, tmp_path / "run.jsonl")
    lines = (tmp_path / "run.jsonl").read_text().splitlines()
    rows = [json.loads(line) for line in lines]
    assert len(rows) == count == 6
    assert [name for name, _ in rows] == [
        "start", "descriptor", "event", "event", "event", "stop",
    ]  # fmt: skip
    start, descriptor, *events, stop = (document for _, document in rows)
    assert descriptor["run_start"] == stop["run_start"] == start["uid"]
    assert [event["seq_num"] for event in events] == [1, 2, 3]
    assert {event["descriptor"] for event in events} == {descriptor["uid"]}
    for event, step in zip(events, done.steps, strict=True):
        assert event["data"].keys() == descriptor["data_keys"].keys()
        assert event["data"]["flux_density"] == step["flux_mT"]
        assert (done.path / event["data"]["photograph"]).is_file()
        assert start["time"] <= event["time"]
    assert descriptor["data_keys"]["gap"]["units"] == "mm"
    assert stop["exit_status"] == "success"
    assert stop["num_events"] == {"primary": 3}
    assert list(documents_of(done)) == list(documents_of(done))


def test_the_event_models_own_schemas_accept_them(done):
    event_model = pytest.importorskip("event_model")
    validators = event_model.schema_validators
    names = event_model.DocumentNames
    for name, document in documents_of(done):
        validators[names[name]].validate(document)


def test_nexus_holds_pictures_numbers_and_units(done, tmp_path):
    import cv2
    import h5py
    import numpy as np

    assert write_nexus(done, tmp_path / "run.nxs") == 3
    with h5py.File(tmp_path / "run.nxs") as file:
        entry = file[file.attrs["default"]]
        plot = entry[entry.attrs["default"]]
        gaps = plot[plot.attrs["axes"][0]]
        assert entry.attrs["NX_class"] == "NXentry"
        assert gaps.attrs["units"] == "mm"
        assert list(gaps) == [step["gap_reached_mm"] for step in done.steps]
        flux = plot[plot.attrs["signal"]]
        assert flux.attrs["units"] == "mT"
        assert list(flux) == [step["flux_mT"] for step in done.steps]
        first = cv2.imread(str(done.path / "images/step_000.png"), -1)
        assert np.array_equal(entry["instrument/camera/data"][0], first)
        rig = json.loads(entry["rig/data"][()])
        assert rig["name"] == "test bench"
    with pytest.raises(StoreError, match="is there already"):
        write_nexus(done, tmp_path / "run.nxs")


def test_a_missing_picture_is_named_and_nothing_is_left_behind(done, tmp_path):
    (done.path / "images/step_001.png").unlink()
    with pytest.raises(StoreError, match="step 2: its photograph is missing"):
        write_nexus(done, tmp_path / "run.nxs")
    assert not [file for file in tmp_path.iterdir() if "nxs" in file.name]


def test_the_command_writes_both_and_refuses_others(done, tmp_path):
    words = ["rig", "export", str(done.path), "--out", str(tmp_path / "x")]
    wrong = CliRunner().invoke(app, [*words, "--to", "matlab"])
    assert "bluesky or nexus" in str(wrong.exception)
    good = CliRunner().invoke(app, [*words, "--to", "bluesky"])
    assert good.output.strip().endswith("6 documents")
