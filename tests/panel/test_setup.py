"""The set-up's own rules: directions are tested, files keep their comments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.panel import Workspace
from magbend.panel.setup.actions import specimen_data
from magbend.panel.setup.board import board_of, tilt
from magbend.panel.setup.steps import STEPS, marks

from .panel_server import Served, served


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    """Return a panel of a twin bench whose gap was never measured."""
    with served(tmp_path_factory.mktemp("fresh") / "bench" / "rig.toml") as server:
        rig = server.panel.workspace.rig_path
        assert server.command("setup-begin", twin=True)["ok"]
        text = rig.read_text()
        lines = [line for line in text.splitlines() if "gap_at_zero_mm = " not in line]
        lines += ["# gap_mm = gap_at_zero_mm + direction * machine_mm"]
        rig.write_text("\n".join(lines) + "\n")
        assert server.command("connect")["ok"]
        yield server


def finish(panel: Served, name: str, **values: Any) -> dict[str, Any]:
    answer = panel.command(name, **values)
    while panel.panel.owner.view().doing:
        pass
    return answer


def test_a_gap_is_not_set_before_the_direction_was_seen(
    fresh: Served,
) -> None:
    assert finish(fresh, "home")["ok"]
    assert finish(fresh, "jog", step_mm=-1.0)["ok"]
    assert "never tested" in fresh.command("setup-gap", gap_mm=147.0)["error"]
    assert not fresh.command("setup-tell-direction", farther="yes")["ok"]
    assert "farther" in fresh.command("setup-try-direction")["text"]
    before = fresh.panel.owner.view().facts["stage_mm"]
    assert (
        "direction = 1" in fresh.command("setup-tell-direction", farther=True)["text"]
    )
    assert fresh.panel.owner.view().facts["stage_mm"] != before
    assert fresh.command("setup-gap", gap_mm=147.0)["ok"]
    facts = fresh.panel.owner.view().facts
    assert facts["gap_mm"] == pytest.approx(147.0, abs=0.01)
    text = fresh.panel.workspace.rig_path.read_text()
    assert "direction_tested = true" in text
    refused = fresh.command("setup-gap", gap_mm=70.0)["error"]
    assert "map said 147.0 mm; this changes it by -77.0 mm" in refused
    assert fresh.panel.workspace.rig_path.read_text() == text
    assert finish(fresh, "goto", gap_mm=145.0)["ok"]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"min_gap_mm": 200.0}, "max_gap_mm must be above min_gap_mm"),
        ({"min_gap_mm": "near"}, "min_gap_mm"),
        ({"direction": 0}, "direction"),
        ({"backend": "webcam"}, "backend"),
        ({"owner": "me"}, "the set-up knows"),
        ({"up": [0, 0, 0]}, "up must be a direction"),
        ({}, "values must be"),
    ],
)
def test_a_value_that_cannot_be_is_refused_and_the_file_stays(
    fresh: Served, values: dict[str, Any], sentence: str
) -> None:
    before = fresh.panel.workspace.rig_path.read_bytes()
    answer = fresh.command("setup-rig", values=values)
    assert sentence in answer["error"]
    assert "/" not in answer["error"].partition(":")[0]  # the file, not a temporary
    assert fresh.panel.workspace.rig_path.read_bytes() == before


def test_the_files_of_a_bench_are_never_overwritten(fresh: Served) -> None:
    assert "not overwritten" in fresh.command("setup-begin")["error"]


def test_steps_are_marked_and_unknown_ones_refused(fresh: Served) -> None:
    folder = fresh.panel.workspace.folder
    assert fresh.command("setup-done", step="interlock")["ok"]
    assert "interlock" in marks(folder)
    assert not fresh.command("setup-done", step="coffee")["ok"]
    state = fresh.query("setup")
    assert [step["name"] for step in state["steps"]] == list(STEPS)
    assert {row["setting"] for row in state["audit"]} >= {"$100", "$110", "$130"}


def test_a_specimen_is_one_of_the_paper_or_ones_own(
    fresh: Served, tmp_path: Path
) -> None:
    assert fresh.command("setup-specimen", gmc=4)["ok"]
    specimen = Workspace(fresh.panel.workspace.rig_path).files().specimen
    assert specimen is not None
    assert specimen.name == "GMC 4"
    own = {
        "name": "mine", "side_mm": 0.9, "remanence_mT": -18.0, "density_kg_m3": None,
        "length_mm": [12.0, 9.0], "E_MPa": [14.0, 7.0],
    }  # fmt: skip
    assert fresh.command("setup-specimen", **own)["ok"]
    assert not fresh.command("setup-specimen", gmc=9)["ok"]
    assert not fresh.command("setup-specimen", **{**own, "side_mm": -1.0})["ok"]
    with pytest.raises(InputError, match="2 lengths and 1 moduli"):
        specimen_data({**own, "E_MPa": [14.0]})


@pytest.mark.parametrize("lean_deg", [30.0, -30.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_tilt_of_the_board_and_its_near_side_are_seen(
    axis: int, lean_deg: float
) -> None:
    import cv2

    board = board_of()
    across, down = board.inner
    corners = board.corners_mm(np.arange(across * down))
    solid = np.column_stack([corners - corners.mean(axis=0), np.zeros(len(corners))])
    about = np.zeros(3)
    about[axis] = np.radians(lean_deg)
    facing = np.diag([1.0, -1.0, -1.0])  # the printed face toward the camera
    seen = solid @ (cv2.Rodrigues(about)[0] @ facing).T + [0.0, 0.0, 200.0]
    points = 1600.0 * seen[:, :2] / seen[:, 2:] + [800.0, 600.0]
    x, y = points[seen[:, 2] < seen[:, 2].min() + 1e-9].mean(axis=0)
    side = ("left" if x < 800.0 else "right") if axis else "top"
    if not axis and y > 600.0:
        side = "bottom"
    angle, toward = tilt(corners, points, (1600, 1200))
    assert angle == pytest.approx(30.0, abs=1.0)
    assert toward == side
