"""The bench over the address of commands: what a script can do, a page can do."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import numpy as np
import pytest

from magbend.core.centreline import Centreline
from magbend.core.errors import InputError, RigError
from magbend.panel.bench.owner import BenchOwner
from magbend.panel.bench.sight import Picture, pack, statistics
from magbend.panel.bench.theory import Place, misfit_mm, model_flux_mT, predict
from magbend.panel.server import Address, listen
from magbend.panel.workspace import Workspace

from .panel_server import Served


def state_of(panel: Served) -> dict[str, object]:
    return dict(panel.panel.owner.view().facts)


def wait_for(condition, timeout_s: float = 20.0) -> None:  # type: ignore[no-untyped-def]
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.fixture(scope="module")
def homed(panel: Served) -> Served:
    panel.command("take", over=True)
    assert panel.command("home")["ok"]
    wait_for(lambda: state_of(panel).get("position_state") == "homed")
    wait_for(lambda: not panel.panel.owner.view().doing)
    return panel


def test_the_interlock_is_told_and_nothing_moves(homed: Served) -> None:
    before = state_of(homed)["gap_mm"]
    answer = homed.command("goto", gap_mm=20.0)
    assert not answer["ok"]
    assert "at least 40 mm" in answer["error"]
    assert state_of(homed)["gap_mm"] == before


@pytest.mark.parametrize("gap", ["60", None, True, [60], {"mm": 60}])
def test_a_gap_must_be_a_number(homed: Served, gap: object) -> None:
    answer = homed.command("goto", gap_mm=gap)
    assert "gap_mm must be a number in mm" in answer["error"]


def test_a_stop_by_a_page_that_only_watches_stops_the_stage(homed: Served) -> None:
    assert homed.command("goto", gap_mm=60.0)["going"]
    wait_for(lambda: 110.0 < (homed.panel.owner.gap_mm or 0.0) < 147.0)
    assert not homed.command("goto", client="watcher", gap_mm=70.0)["ok"]
    assert homed.command("stop", client="watcher")["ok"]
    wait_for(lambda: not homed.panel.owner.view().doing)
    facts = state_of(homed)
    assert facts["state"] == "idle"
    assert facts["position_state"] == "homed"
    assert float(str(facts["gap_mm"])) > 65.0


def test_every_command_is_logged_with_its_source(homed: Served, bench: Path) -> None:
    homed.command("jog", step_mm=0.5)
    lines = (bench.parent / "panel-log.jsonl").read_text().splitlines()
    records = [json.loads(line) for line in lines]
    last = next(item for item in reversed(records) if item["command"] == "jog")
    assert last["arguments"] == {"step_mm": 0.5}
    assert "127.0.0.1" in last["source"]
    assert any(item["outcome"].startswith("refused") for item in records)


def test_the_panel_answers_rig_status_and_rig_stop(homed: Served, bench: Path) -> None:
    from magbend.rig import ask

    assert ask(bench, "status")["command"] == "panel"
    assert "stop" in ask(bench, "stop")["text"]


def test_a_taken_port_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(RigError, match=f"port {port} .* is taken.*--port"):
            listen(Address(port=port))


@pytest.mark.parametrize("host", ["bench.local", "", "127.0.0.1:80"])
def test_a_host_must_be_an_address(host: str) -> None:
    with pytest.raises(InputError, match="address of this machine"):
        Address(host=host)


def test_a_missing_and_a_broken_rig_file_are_sentences(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "rig.toml")
    assert "no such file" in workspace.files().problems["rig"]
    (tmp_path / "rig.toml").write_text('name = "x"\n[stage]\ngap_at_zero = 3.0\n')
    sentence = workspace.files().problems["rig"]
    assert "line 3" in sentence
    assert "gap_at_zero_mm" in sentence


def test_prediction_follows_the_gap_and_says_why_there_is_none(bench: Path) -> None:
    files = Workspace(bench).files()
    near, far = (predict(files, Place(gap_mm=gap)) for gap in (50.0, 90.0))
    for name in ("magnet.nominal", "uniform.nominal"):
        assert near[name].centreline.tip_mm[1] > far[name].centreline.tip_mm[1] > 0.0
    reading = predict(files, Place(gap_mm=90.0, flux_mT=60.0))["uniform.nominal"]
    assert reading.centreline.tip_mm[1] > far["uniform.nominal"].centreline.tip_mm[1]
    empty = Workspace(bench.parent / "nothing" / "rig.toml").files()
    none = predict(empty, Place(gap_mm=60.0))
    assert "specimen" in none["magnet.nominal"]


def test_the_models_field_is_that_of_the_paper(bench: Path) -> None:
    rig = Workspace(bench).files().rig
    assert rig is not None
    assert rig.magnet is not None
    # DESIGN: 50 mT at 60 mm belongs to a remanence of 1.3050 T.
    flux_mT = model_flux_mT(rig.magnet.magnet(), 30.0, 60.0)
    assert flux_mT == pytest.approx(50.0, abs=0.02)


def test_misfit_of_a_shifted_line_is_the_shift() -> None:
    s = np.linspace(0.0, 30.0, 61)
    flat = {"s_mm": s, "theta_rad": 0.0 * s, "kappa_per_mm": 0.0 * s}
    one = Centreline(x_mm=s, y_mm=0.0 * s, **flat)
    other = Centreline(x_mm=s, y_mm=0.0 * s + 0.25, **flat)
    assert misfit_mm(one, other) == pytest.approx((0.25, 0.25))


def test_pictures_of_any_depth_are_shown() -> None:
    grey = np.tile(np.linspace(0, 65535, 640).astype(np.uint16), (480, 1))
    for image in (grey, (grey >> 8).astype(np.uint8), grey.astype(np.float32) / 65535):
        packed = pack(Picture(image=image, number=1, arrival_s=0.0, gap_mm=None))
        assert packed.jpeg.startswith(b"\xff\xd8")
        found = statistics(image)
        assert sum(found["histogram"]) == pytest.approx(1.0, abs=1e-3)
    sharp = np.kron(np.indices((60, 80)).sum(0) % 2, np.ones((8, 8))) * 200.0
    blurred = np.full_like(sharp, sharp.mean())
    assert statistics(sharp.astype(np.uint8))["focus"] > 10.0
    assert statistics(blurred.astype(np.uint8))["focus"] < 0.1


def test_an_owner_that_cannot_open_says_so_and_goes_on() -> None:
    def fail():  # type: ignore[no-untyped-def]
        raise RigError("no board answers")

    owner = BenchOwner(fail, lambda: None, lambda: True)
    owner.begin()
    with pytest.raises(RigError, match="no board answers"):
        owner.open().result(timeout=5)
    assert owner.view().trouble == "no board answers"
    owner.close()
