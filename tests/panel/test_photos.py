"""Points on a photograph: a rescued measurement, a wanted curve, nothing else."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.panel import Workspace
from magbend.panel.photos.gallery import list_photos, photo_path
from magbend.rig import encode_png

from .panel_server import Served


@pytest.fixture(scope="module")
def photo(panel: Served, bench: Path) -> tuple[str, np.ndarray]:
    """Return a photograph in the bench's folder, and the true line in it, px."""
    from magbend.analysis.twin.run import open_twin_bench
    from magbend.rig import SteppedClock, read_plan
    from magbend.vision import Setting, as_photo, measure, read_calibration

    plan = read_plan(bench.parent / "plan.toml")
    twin, devices = open_twin_bench(plan, seed=2, clock=SteppedClock())
    image = twin.photograph(60.0, 0.0)
    devices.close()
    (bench.parent / "by_hand.png").write_bytes(encode_png(image))
    calibration = read_calibration(bench.parent / "calibration.json")
    line = measure(as_photo(image), Setting(calibration=calibration)).points_px
    return "by_hand.png", line


def test_only_photographs_of_the_folder_are_shown(
    photo: tuple[str, np.ndarray], bench: Path
) -> None:
    workspace = Workspace(bench)
    assert photo[0] in list_photos(workspace)
    for name in ("../secret.png", "rig.toml", "/etc/passwd", "", "none.png"):
        with pytest.raises(InputError, match="no photograph"):
            photo_path(workspace, name)


def test_the_size_is_that_of_the_original(
    panel: Served, photo: tuple[str, np.ndarray]
) -> None:
    assert panel.query(f"photo-size?name={photo[0]}")["size_px"] == [1600, 1200]
    small = panel.request("GET", f"/api/photo?name={photo[0]}&width=320")[1]
    assert small.startswith(b"\xff\xd8")
    assert not panel.query(f"photo?name={photo[0]}&width=9999999")["ok"]


@pytest.mark.parametrize(
    "points",
    [None, [], [[1, 2]], [[1, 2], [3]], [[1, 2], ["a", 3]], [[0, 0]] * 500],
)
def test_points_that_are_none_are_refused(
    panel: Served, photo: tuple[str, np.ndarray], points: Any
) -> None:
    panel.command("take", over=True)
    assert not panel.command("point", photo=photo[0], points=points)["ok"]
    assert not panel.command("design", points=points, gap_mm=60.0)["ok"]


def test_a_curve_that_is_drawn_gives_rods_that_take_it(
    panel: Served, photo: tuple[str, np.ndarray], bench: Path
) -> None:
    panel.command("take", over=True)
    drawn = photo[1][:: len(photo[1]) // 8].round(1).tolist()
    name = panel.command("design", points=drawn, gap_mm=60.0)["design"]
    job = finished(panel, "design")
    assert job["status"] == "done", job["lines"]
    assert job["command"].startswith("magbend analysis design --polyline")
    found = json.loads((bench.parent / "designs" / name / "design_1.json").read_text())
    length_mm = sum(section["length_mm"] for section in found["section"])
    assert length_mm == pytest.approx(30.0, abs=0.6)
    figure = panel.request("GET", f"/api/design-figure?name={name}")[1]
    assert b"<svg" in figure
    assert not panel.query("design-figure?name=../x")["ok"]


def finished(panel: Served, what: str) -> dict[str, Any]:
    """Wait for the newest job of a kind."""
    deadline = time.monotonic() + 90.0
    while True:
        jobs = [job for job in panel.panel.jobs.facts() if job["what"] == what]
        if jobs and jobs[0]["status"] in ("done", "failed"):
            return jobs[0]
        assert time.monotonic() < deadline
        time.sleep(0.05)
