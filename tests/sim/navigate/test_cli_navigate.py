"""``magbend sim navigate`` and ``steer``: what is typed, printed and written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer import BadParameter
from typer.testing import CliRunner

from magbend.cli import sim
from magbend.core.centreline import Centreline
from magbend.core.errors import ConfigError, InputError, SolverError
from magbend.core.toml import read_toml
from magbend.rig.bench.config import PlanModel
from magbend.sim import UniformField, gmc
from magbend.sim.navigate import (
    Reach,
    moving,
    navigate,
    navigate_many,
    read_lumen,
    read_poses,
    steer,
)

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"
FORK, BEND, ARCH = (
    str(FIXTURES / "lumens" / f"{name}.toml") for name in ("fork", "bend90", "arch")
)
RUN = CliRunner()


def run(*arguments: str) -> str:
    result = RUN.invoke(sim.app, list(arguments), standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def test_a_passage_is_printed_and_written(tmp_path):
    out = tmp_path / "passage"
    text = run(
        "navigate", BEND, "--gmc", "2", "--way-mm", "12", "--step-mm", "1",
        "--out", str(out), "--branches",
    )  # fmt: skip
    assert "GMC 2 in 90 degree bend: inserted" in text
    assert "branches        none: the rod did not snap" in text
    heads = (out / "steps.csv").read_text().splitlines()[0].split(",")
    assert heads[:2] == ["insertion_mm", "push_N"]
    assert Centreline.from_csv(out / "shape.csv").length_mm == pytest.approx(12.0)
    assert json.loads((out / "passage.json").read_text())["reached_mm"] == 12.0
    with Image.open(out / "passage.gif") as film:
        assert film.n_frames > 5
        assert np.ptp(np.asarray(film.convert("L"))) > 100
    forces = np.genfromtxt(out / "contacts.csv", delimiter=",", names=True)
    assert (forces["force_N"] > 0.0).all()


def test_the_branch_that_a_snap_leaves_is_printed_and_written(tmp_path):
    """A soft rod in a field that turns past it; each state has its index."""
    rod, lumen, poses = (tmp_path / f"{name}.toml" for name in ("rod", "wide", "poses"))
    rod.write_text(
        'name = "soft"\nside_mm = 1.0\nremanence_mT = 60.0\n'
        "[[section]]\nlength_mm = 30.0\nE_MPa = 2.0\n"
    )
    lumen.write_text(
        'name = "wide"\n[channel]\nwidth_mm = 90.0\n'
        "[[channel.leg]]\nstraight_mm = 100.0\n"
    )
    poses.write_text(
        "\n".join(
            f"[[pose]]\ninsertion_mm = {at}\nflux_mT = 40.0\nangle_deg = {angle}"
            for at, angle in ((1.0, 150.0), (28.0, 150.0), (29.3, 267.0))
        )
    )
    given = (
        "navigate", str(lumen), "--specimen", str(rod), "--poses", str(poses),
        "--way-mm", "28", "--way-mm", "29.3", "--branches",
    )  # fmt: skip
    out = tmp_path / "passage"
    (told,) = json.loads(run(*given, "--out", str(out), "--json"))["branches"]
    assert told["folds_mm"][0] == pytest.approx(29.2896, abs=2e-3)
    assert {step["index"] for step in told["steps"]} == {0, 1}
    states = np.genfromtxt(out / "branches.csv", delimiter=",", names=True)
    assert list(states["index"]) == [step["index"] for step in told["steps"]]


def test_a_passage_through_a_tube_is_printed_and_written(tmp_path):
    out = tmp_path / "passage"
    text = run(
        "navigate", ARCH, "--gmc", "2", "--field-mT", "20", "--elevation-deg", "40",
        "--step-mm", "5", "--out", str(out),
    )  # fmt: skip
    assert "GMC 2 in arch: inserted" in text
    assert "gates           top" in text
    shape = np.genfromtxt(out / "shape.csv", delimiter=",", names=True)
    assert shape["s_mm"][-1] == pytest.approx(30.0)
    tangent = np.array([shape[name] for name in ("tx", "ty", "tz")])
    assert np.linalg.norm(tangent, axis=0) == pytest.approx(1.0)
    steps = np.genfromtxt(out / "steps.csv", delimiter=",", names=True)
    assert steps["tip_z_mm"][-1] == pytest.approx(shape["z_mm"][-1])
    assert (steps["residual_Nmm"] < 1e-7).all()
    forces = np.genfromtxt(out / "contacts.csv", delimiter=",", names=True)
    assert (forces["along_mm"] > 0.0).all()
    for name in ("passage.png", "passage.gif"):
        with Image.open(out / name) as picture:
            assert np.ptp(np.asarray(picture.convert("L"))) > 100


def test_json_holds_every_step_and_contact():
    data = json.loads(
        run("navigate", BEND, "--gmc", "2", "--way-mm", "14", "--json")
    )  # fmt: skip
    assert data["outcome"] == "inserted"
    assert len(data["steps"]) == 28
    assert {"wall", "s_mm", "force_N"} < set(data["steps"][-1]["contacts"][0])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("nowhere.toml", "--gmc", "2"), "there is no such file"),
        ((BEND, "--gmc", "9"), "GMC number must be from 1 to 7"),
        (
            (BEND, "--gmc", "2", "--field-mT", "9", "--elevation-deg", "30"),
            "must be within its plane .* one that leaves it: a tube takes it",
        ),
        ((BEND, "--gmc", "2", "--step-mm", "100"), "step_mm must be from .* to 30 mm"),
        ((BEND, "--gmc", "2", "--friction", "nan"), "friction must be a finite number"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(given, said):
    with pytest.raises((ConfigError, InputError), match=said):
        run("navigate", *given)


@pytest.mark.parametrize(
    "given",
    [
        ("--angle-deg", "30"),
        ("--elevation-deg", "30"),
        ("--magnet", "m.toml", "--gap-mm", "60", "--angle-deg", "30"),
    ],
)
def test_a_direction_without_a_field_is_refused(given):
    with pytest.raises(BadParameter, match="belongs to --field-mT"):
        run("navigate", BEND, "--gmc", "2", *given)


def test_a_field_given_twice_is_refused():
    poses = str(FIXTURES / "lumens" / "steer.toml")
    with pytest.raises(BadParameter, match="either --field-mT or flux_mT in the"):
        run("navigate", BEND, "--gmc", "2", "--field-mT", "20", "--poses", poses)


def test_a_magnets_path_through_a_branch_is_a_plan_and_poses_that_do_it(tmp_path):
    magnet = tmp_path / "cube.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    rod = FIXTURES / "specimens" / "gmc2.toml"
    out = tmp_path / "steered"
    text = run(
        "steer", FORK, "--gate", "left branch", "--specimen", str(rod),
        "--magnet", str(magnet), "--every-mm", "6", "--change-mm", "20",
        "--out", str(out),
    )  # fmt: skip
    assert "passes 'left branch'" in text
    plan = read_toml(out / "plan.toml", PlanModel)
    assert plan.gaps_mm == sorted(plan.gaps_mm, reverse=True)
    again = run(
        "navigate", FORK, "--specimen", str(rod), "--magnet", str(magnet),
        "--poses", str(out / "poses.toml"), "--way-mm", "24", "--json",
    )  # fmt: skip
    assert json.loads(again)["gates"] == ["left branch"]


def test_a_branch_out_of_reach_is_named():
    fork = read_lumen(Path(FORK))
    weak = {"flux_mT": Reach(low=0.0, high=1.0, change=0.5)}
    with pytest.raises(SolverError, match="no fields within reach"):
        steer(
            gmc(2),
            fork,
            None,
            weak,
            gate="right branch",
            start={"flux_mT": 1.0},
            every_mm=10.0,
        )
    with pytest.raises(InputError, match="gate must be a gate of the lumen"):
        steer(gmc(2), fork, None, weak, gate="middle", start={"flux_mT": 1.0})


def test_steering_to_the_mirrored_gate_takes_the_mirrored_field():
    fork = read_lumen(Path(FORK))
    reach = {"flux_mT": Reach(low=-60.0, high=60.0, change=20.0)}
    left, right = (
        steer(
            gmc(2), fork, None, reach, gate=gate, start={"flux_mT": 0.0}, every_mm=6.0
        )
        for gate in ("left branch", "right branch")
    )
    for a, b in zip(left.poses, right.poses, strict=True):
        assert a["flux_mT"] == -b["flux_mT"]
    assert moving(None, left.poses)(6.0).flux_mT > 0.0


def test_many_rods_go_as_each_by_itself():
    bend = read_lumen(Path(BEND))
    nothing = UniformField(flux_mT=0.0)
    rods = [gmc(n) for n in (1, 2, 3)]
    together = navigate_many(rods, bend, nothing, way_mm=14.0)
    for rod, way in zip(rods, together, strict=True):
        alone = navigate(rod, bend, nothing, way_mm=14.0, refine=False)
        assert way.steps[-1].tip_mm == alone.steps[-1].tip_mm


def test_the_example_of_poses_is_read():
    poses = read_poses(FIXTURES / "lumens" / "steer.toml")
    assert moving(None, poses)(5.0).flux_mT == pytest.approx(30.0)
