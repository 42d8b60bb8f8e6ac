"""A run from the panel: its own process, watched, paused, aborted, resumed."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from magbend.core.errors import ConfigError, InputError, StoreError
from magbend.panel import Workspace
from magbend.panel.runs import supervisor as supervisors
from magbend.panel.runs.listing import run_detail
from magbend.panel.runs.plan_file import check_plan, write_plan
from magbend.panel.toml_edit import edited

from .panel_server import Served, served


def wait_for(condition: Callable[[], Any], timeout_s: float = 40.0) -> Any:
    deadline = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


def facts_of(panel: Served) -> dict[str, Any]:
    return dict(panel.panel.supervisor.facts or {})


def start(panel: Served) -> str:
    """Start a run and return its name."""
    wait_for(lambda: not panel.panel.supervisor.is_running)
    answer = panel.command("run-start")
    assert answer["ok"], answer
    return str(answer["run"])


def test_a_run_is_paused_aborted_and_resumed(panel: Served, bench: Path) -> None:
    panel.command("take", over=True)
    name = start(panel)
    wait_for(lambda: facts_of(panel).get("state") in ("moving", "settling"))
    pid = facts_of(panel)["pid"]
    assert pid != os.getpid()
    assert os.getsid(pid) != os.getsid(0)  # the panel's end does not reach it

    assert not panel.command("goto", gap_mm=70.0)["ok"]
    assert "run has the bench" in panel.command("home")["error"]
    assert panel.command("run-pause")["ok"]
    wait_for(lambda: facts_of(panel).get("state") == "paused")
    assert panel.command("run-resume")["ok"]
    wait_for(lambda: facts_of(panel).get("state") not in ("paused", None))
    # Whoever watches may stop it.
    assert panel.command("stop", client="watcher")["ok"]
    wait_for(lambda: panel.panel.supervisor.facts is None)
    detail = panel.query(f"run?name={name}")
    assert detail["status"] == "abort"
    assert len(detail["steps"]) < 3

    assert panel.command("run-start", resume=name)["ok"]
    wait_for(lambda: panel.query(f"run?name={name}")["status"] == "success")
    wait_for(lambda: panel.panel.owner.parts is not None)  # the bench is ours again
    listed = panel.query("runs")
    assert listed[0]["name"] == name
    assert listed[0]["status"] == "success"
    assert listed[0]["twin"]
    status, body, headers = panel.request("GET", f"/runs/{name}/images/step_000.png")
    assert (status, headers["content-type"]) == (200, "image/png")
    assert body.startswith(b"\x89PNG")
    small = panel.request("GET", f"/runs/{name}/images/step_000.png?width=240")
    assert small[1].startswith(b"\xff\xd8")


def test_a_stop_reaches_a_run_that_has_not_said_a_word(panel: Served) -> None:
    panel.command("take", over=True)
    name = start(panel)
    assert panel.panel.supervisor.facts is None
    assert "before it began" in panel.command("stop", client="watcher")["text"]
    wait_for(lambda: not panel.panel.supervisor.is_running)
    assert not panel.panel.workspace.runs_path.joinpath(name, "images").exists()
    wait_for(lambda: panel.panel.owner.parts is not None)


def test_a_run_that_ends_late_is_not_taken_for_the_next_one(
    panel: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stop was told to the process of the run before, and the new run went on."""
    told: list[dict[str, Any]] = []
    ended = [threading.Event(), threading.Event()]
    waiting = iter([SimpleNamespace(wait=event.wait) for event in ended])
    monkeypatch.setattr(supervisors, "start", lambda *_, **__: next(waiting))
    monkeypatch.setattr("magbend.rig.watch", lambda *_, **__: iter(told))
    monkeypatch.setattr("magbend.rig.ask", lambda *_, **__: told[0])
    supervisor = supervisors.Supervisor(panel.panel.workspace, lambda: None)
    others = set(threading.enumerate())
    supervisor.start([], tmp_path / "first")
    (first,) = set(threading.enumerate()) - others
    told.append({"pid": 1})
    supervisor._follow()
    assert supervisor.facts == told[0]
    supervisor._facts = None  # it is silent, but its process has not ended
    supervisor.start([], tmp_path / "second")
    supervisor._follow()
    assert supervisor.facts is None
    ended[0].set()
    first.join(timeout=5.0)
    assert supervisor.is_starting
    told[0] = {"pid": 2}
    supervisor._follow()
    assert supervisor.facts == {"pid": 2}
    ended[1].set()


def test_a_run_outlives_the_panel_and_is_found_again(tmp_path: Path) -> None:
    from magbend.panel import prepare_demo

    rig = prepare_demo(tmp_path / "bench", seed=2)
    with served(rig) as first:
        name = start(first)
        pid = wait_for(lambda: facts_of(first).get("pid"))
    os.kill(pid, 0)  # the panel is gone; the run is not
    with served(rig) as second:
        wait_for(lambda: facts_of(second).get("pid") == pid)
        # A run that has just begun has no folder yet.
        wait_for(lambda: second.panel.supervisor.last_run == name)
        assert second.command("run-abort")["ok"]
        wait_for(lambda: second.panel.supervisor.facts is None)
        assert second.query(f"run?name={name}")["status"] == "abort"


def test_a_run_that_is_killed_can_be_resumed(panel: Served) -> None:
    panel.command("take", over=True)
    name = start(panel)
    pid = wait_for(lambda: facts_of(panel).get("pid"))
    wait_for(lambda: facts_of(panel).get("state") in ("moving", "settling"))
    os.kill(pid, signal.SIGKILL)
    wait_for(lambda: panel.panel.supervisor.facts is None)
    detail = panel.query(f"run?name={name}")
    assert detail["status"] == "running or cut off"
    assert any("cut off" in warning for warning in detail["warnings"])
    wait_for(lambda: panel.panel.owner.parts is not None)


def test_the_editor_keeps_the_comments_of_a_plan(bench: Path) -> None:
    text = (bench.parent / "plan.toml").read_text()
    values = {("gaps_mm",): [80.0, 65.0], ("settle", "time_s"): 1.5}
    changed = edited(text, values)
    assert "# when is the rod still?" in changed
    assert "gaps_mm = [80.0, 65.0]" in changed
    assert "time_s = 1.5" in changed
    with pytest.raises(InputError, match="the plan editor knows"):
        write_plan(Workspace(bench), {"feed": 3})


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"gaps_mm": [60.0, 30.0]}, "under the interlock of 40 mm"),
        ({"gaps_mm": [50.0, 60.0]}, "must fall"),
        ({"gaps_mm": []}, "gaps_mm"),
        ({"gaps_mm": ["near"]}, "gaps_mm"),
        ({"settle_s": -1.0}, "time_s"),
        ({"frames": 0}, "frames"),
        ({"name": 3}, "name"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_and_nothing_is_written(
    bench: Path, values: dict[str, Any], sentence: str
) -> None:
    workspace = Workspace(bench)
    before = workspace.plan_path.read_bytes()
    with pytest.raises(ConfigError, match=r"plan\.toml") as refused:
        write_plan(workspace, values)
    assert sentence in str(refused.value)
    assert workspace.plan_path.read_bytes() == before
    assert not list(workspace.folder.glob(".edited-*"))


def test_a_plan_is_foreseen_step_by_step(bench: Path) -> None:
    found = check_plan(Workspace(bench), {"gaps_mm": [90.0, 60.0]})
    far, near = found["steps"]
    assert near["flux_mT"] > far["flux_mT"] > 0.0
    assert near["shape_mm"][-1][1] > far["shape_mm"][-1][1]
    assert found["total_s"] > far["time_s"] + near["time_s"]


def test_a_job_is_the_command_a_person_would_type(panel: Served) -> None:
    panel.command("take", over=True)
    name = panel.query("runs")[0]["name"] if panel.query("runs") else None
    if name is None:
        pytest.skip("no run was made before")
    assert panel.command("job", what="verify", runs=[name])["ok"]
    job = wait_for(
        lambda: next(
            (
                job
                for job in panel.panel.jobs.facts()
                if job["what"] == "verify" and job["status"] in ("done", "failed")
            ),
            None,
        )
    )
    assert job["command"] == f"magbend rig verify runs/{name}"
    assert not panel.command("job", what="erase", runs=[name])["ok"]
    for runs in ([], ["../.."], [".."], "all", [name, "none"]):
        assert not panel.command("job", what="fit", runs=runs)["ok"]


def test_a_demo_leaves_the_folder_of_somebody_else_alone(tmp_path):
    from magbend.panel import prepare_demo

    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(StoreError, match="was not made by magbend"):
        prepare_demo(tmp_path, seed=2)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_an_imported_run_of_shapes_has_no_photographs(tmp_path: Path) -> None:
    """The files of its steps are shapes: no picture to be shown or extracted."""
    from magbend.analysis import import_table
    from magbend.sim import UniformField, gmc, solve

    (tmp_path / "rod.toml").write_text(
        'name = "rod"\nside_mm = 1.0\nremanence_mT = 20.07\n'
        + "".join(
            f"[[section]]\nlength_mm = 10.0\nE_MPa = {E}\n" for E in (20.0, 15.0, 10.0)
        )
    )
    shape = solve(gmc(2), UniformField(flux_mT=50.0)).centreline
    assert shape is not None
    shape.to_csv(tmp_path / "s.csv")
    (tmp_path / "t.csv").write_text("centreline,gap_mm,flux_mT\ns.csv,60,50\n")
    import_table(
        tmp_path / "t.csv",
        tmp_path / "runs" / "ours",
        specimen_file=tmp_path / "rod.toml",
    )
    found = run_detail(Workspace(tmp_path / "rig.toml"), "ours")
    assert [step["image"] for step in found["steps"]] == [None]
    assert found["has"] == ["extract"]
