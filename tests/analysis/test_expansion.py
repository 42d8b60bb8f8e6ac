"""The expansion model: what it predicts, what it does not know, what it refuses."""

from __future__ import annotations

import io
import json
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.analysis.expansion import model as expansion
from magbend.analysis.expansion.data import SPLITS, held_out, inputs_of, training_set
from magbend.analysis.expansion.train import train
from magbend.cli.main import app
from magbend.core.errors import InputError, MissingExtraError, StoreError
from magbend.sim import gmc

GMC_2 = [50.0, 20.0, 15.0, 10.0, 10.0, 10.0, 10.0, 0.97]


@pytest.fixture(scope="module")
def data():
    return training_set()


def test_the_training_set_is_that_of_the_paper(data):
    assert data.inputs.shape == (84, 8)
    assert sorted(set(data.inputs[:, 7])) == [0.8, 0.97, 1.3]
    assert data.a_per_mm.min() == pytest.approx(8.35e-4, rel=1e-3)
    assert data.a_per_mm.max() == pytest.approx(1.871e-2, rel=1e-3)


@pytest.mark.parametrize("seed", range(10))
def test_splits_hold_out_what_they_say(seed):
    field, top, specimen = (held_out(name, seed).reshape(7, 12) for name in SPLITS)
    assert field.sum(axis=1).tolist() == [1] * 7
    assert top[:, -1].all()
    assert top.sum() == 7
    assert sorted(specimen.sum(axis=1).tolist()) == [0] * 6 + [12]
    assert held_out("field", seed).tolist() == field.ravel().tolist()


def test_the_packaged_model_knows_its_specimens(data):
    model = expansion.load()
    error = expansion.predict(model, data.inputs) - data.a_per_mm
    assert np.mean(error**2) < 1e-8
    assert not any(expansion.outside(model, row) for row in data.inputs)
    errors = model.card["errors"]
    assert errors["field"]["median_test_mse_per_mm2"] < 1e-8
    medians = [errors[split]["median_test_mse_per_mm2"] for split in SPLITS]
    assert medians == sorted(medians)  # transfer is ever harder


def test_outside_the_domain_is_said():
    model = expansion.load()
    beyond = expansion.outside(model, [150.0, *GMC_2[1:]])
    assert any("flux_mT = 150 is outside" in sentence for sentence in beyond)
    other = expansion.outside(model, [*GMC_2[:-1], 1.1])
    assert len(other) == 1
    assert "none of the trained specimens" in other[0]


@pytest.mark.parametrize("bad", [[1.0], [*GMC_2[:-1], 0.0], [np.nan, *GMC_2[1:]]])
def test_impossible_inputs_are_refused(bad):
    with pytest.raises(InputError):
        expansion.predict(expansion.load(), bad)


def test_models_survive_the_round_trip(tmp_path):
    model = expansion.load()
    expansion.save(model, tmp_path / "m.npz")
    again = expansion.load(tmp_path / "m.npz")
    same = expansion.predict(again, GMC_2) == expansion.predict(model, GMC_2)
    assert same.all()
    assert again.card == model.card


@pytest.mark.parametrize("damage", ["missing", "cut", "flipped", "other", "pickle"])
def test_damaged_models_are_one_sentence(tmp_path, damage):
    path = tmp_path / "m.npz"
    expansion.save(expansion.load(), path)
    content = bytearray(path.read_bytes())
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
    elif damage == "other":
        np.savez(path, x=np.zeros(3))
    else:
        buffer = io.BytesIO()
        np.savez(buffer, mean=np.array([{}], dtype=object))
        path.write_bytes(buffer.getvalue())
    with pytest.raises(StoreError, match=r"m\.npz: (is damaged|there is no such)"):
        expansion.load(path)


def test_training_reports_every_seed_of_every_split():
    pytest.importorskip("jax")
    pytest.importorskip("optax")
    report = train(seeds=2, steps=150)
    printed = report.as_dict()
    assert set(printed["test_mse_per_mm2"]) == set(SPLITS)
    assert all(len(errors) == 2 for errors in printed["test_mse_per_mm2"].values())
    field = printed["test_mse_per_mm2"]["field"]
    assert printed["median_test_mse_per_mm2"] == pytest.approx(np.median(field))
    assert max(field) < 2e-5  # untrained: 1e-4
    json.dumps(report.model.card, allow_nan=False)


@pytest.mark.slow
def test_the_same_seed_trains_the_same_network():
    pytest.importorskip("jax")
    pytest.importorskip("optax")
    first, second = (train(seeds=1, steps=20).as_dict() for _ in range(2))
    assert first == second


@pytest.mark.slow
def test_the_published_error_is_beaten_twentyfold():
    pytest.importorskip("jax")
    pytest.importorskip("optax")
    assert train(seeds=10).as_dict()["median_test_mse_per_mm2"] <= 1e-8


def test_without_jax_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(MissingExtraError, match=r"pip install \"\.\[train\]\""):
        train(seeds=1, steps=1)


def test_predict_command():
    runner = CliRunner()
    asked = ["analysis", "predict", "--gmc", "2", "--field-mT", "50", "--json"]
    answer = json.loads(runner.invoke(app, asked).stdout)
    model = expansion.load()
    expected = expansion.predict(model, inputs_of(gmc(2, remeasured=True), 50.0))[0]
    assert answer["a_per_mm"] == expected
    assert answer["inside_domain"]
    far = runner.invoke(app, [*asked[:4], "--field-mT", "500"])
    assert "outside the trained range" in far.stderr


def test_no_steps_are_not_the_default_number():
    result = CliRunner().invoke(app, ["analysis", "train", "--steps", "0"])
    assert isinstance(result.exception, InputError)
    assert "steps must be from 1" in str(result.exception)
