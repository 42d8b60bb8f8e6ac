"""A second axis: within its limits, dry-run, recorded, verified, brought to rest."""

from __future__ import annotations

import json
import os
import threading

import pytest

from magbend.core.errors import ConfigError, RigError
from magbend.rig.axes.config import AxisConfig, why_not_set
from magbend.rig.axes.line import LineAxis
from magbend.rig.bench.config import read_plan
from magbend.rig.bench.template import write_templates
from magbend.rig.clock import SteppedClock, SystemClock
from magbend.rig.runs.dry_run import plan_steps
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run
from magbend.rig.virtual.bench import open_twin

from .twin_run import render

AXIS = """
[[axis]]
name = "current_A"
driver = "twin"
min = 0.0
max = 2.0
rest = 0.0
"""
SCAN = """
[[scan]]
axis = "current_A"
values = [0.0, 1.5]
"""


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


def _plan(tmp_path, axis: str = AXIS, scan: str = SCAN, keys: str = ""):
    write_templates(tmp_path, twin=True)
    for name, text in (("rig.toml", axis), ("plan.toml", scan)):
        path = tmp_path / name
        path.write_text(path.read_text() + text)
    path = tmp_path / "plan.toml"
    text = path.read_text().replace('rig = "rig.toml"\n', f'rig = "rig.toml"\n{keys}')
    path.write_text(text)
    return read_plan(path)


def test_each_value_is_taken_at_each_gap_and_the_current_ends_at_rest(tmp_path):
    plan = _plan(tmp_path, keys="reference = true\n")
    rows = [(step.gap_mm, dict(step.settings)) for step in plan_steps(plan)]
    assert rows[0] == (149.0, {"current_A": 0.0})
    assert rows[1:3] == [(70.0, {"current_A": 0.0}), (70.0, {"current_A": 1.5})]
    assert len(rows) == 7
    devices = open_twin(
        plan.rig, render, lambda gap_mm: 38.0 * (70.0 / gap_mm) ** 2,
        clock=SteppedClock(),
    )  # fmt: skip
    summary = run(plan, devices, tmp_path / "run")
    devices.close()
    assert summary.status == "success"
    assert devices.axes["current_A"].value == 0.0
    steps = read_run(tmp_path / "run").steps
    assert [step["settings"]["current_A"] for step in steps] == [0.0] + [0.0, 1.5] * 3
    assert verify_run(tmp_path / "run") == []
    path = tmp_path / "run" / "steps.jsonl"
    lines = path.read_text().splitlines()
    lines[2] = lines[2].replace('"current_A": 1.5', '"current_A": 1.4')
    path.write_text("\n".join(lines) + "\n")
    problems = "\n".join(verify_run(tmp_path / "run"))
    assert "step 3: current_A is 1.4, the plan says 1.5" in problems


@pytest.mark.parametrize(
    ("axis", "scan", "said"),
    [
        (AXIS.replace("max = 2.0\n", ""), SCAN, "max"),
        (AXIS, SCAN.replace("1.5", "2.5"), "must be from 0 to 2; instead received 2.5"),
        (AXIS, SCAN.replace("current_A", "angle_deg"), "is no \\[\\[axis\\]\\]"),
        (AXIS, SCAN + SCAN, "scanned twice"),
        (AXIS + AXIS, SCAN, "a name of its own"),
        (AXIS.replace('"twin"', '"line"'), SCAN, "needs a port"),
        (AXIS.replace("min = 0.0", "min = nan"), SCAN, "min"),
    ],
)
def test_what_has_no_limits_or_passes_them_is_refused(tmp_path, axis, scan, said):
    with pytest.raises(ConfigError, match=said):
        _plan(tmp_path, axis, scan)


class Supply:
    """A supply on a pseudo-terminal that takes ``CURR x`` and answers ``CURR?``."""

    def __init__(
        self, *, sticks_at: float | None = None, answer: str = "{:.4f} A"
    ) -> None:
        import tty

        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port, self._slave = os.ttyname(slave), slave
        self.seen: list[str] = []
        self._value, self._sticks_at, self._answer = 0.0, sticks_at, answer
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        buffer = b""
        while True:
            try:
                buffer += os.read(self.master, 64)
            except OSError:
                return
            while b"\n" in buffer:
                line, _, buffer = buffer.partition(b"\n")
                self.seen.append(line.decode())
                if line == b"CURR?":
                    os.write(
                        self.master, f"{self._answer}\n".format(self._value).encode()
                    )
                elif line.startswith(b"CURR "):
                    asked = float(line[5:])
                    self._value = self._sticks_at if self._sticks_at else asked

    def axis(self) -> LineAxis:
        config = AxisConfig(
            name="current_A", port=self.port, min=0.0, max=2.0, settle_s=0.01,
            set_line="CURR {value:.3f}", read_line="CURR?", timeout_s=0.2,
        )  # fmt: skip
        return LineAxis(config, SystemClock())


def test_a_supply_is_set_and_read_back():
    supply = Supply()
    axis = supply.axis()
    assert axis.set(1.25) == pytest.approx(1.25)
    with pytest.raises(RigError, match=r"from 0 to 2.*nothing was sent"):
        axis.set(2.5)
    axis.close()
    assert supply.seen == ["CURR 1.250", "CURR?"]
    json.dumps(axis.identity)


@pytest.mark.parametrize("answer", ["CURR?\n{:.4f} A", "CH1 {:.4f}", "OUT-1={:.3e}A"])
def test_a_number_in_an_echo_or_a_name_is_no_reading(answer):
    # Stuck at 0 A, a supply must not seem to reach the 1 A of its channel's name.
    axis = Supply(sticks_at=1e-9, answer=answer).axis()
    with pytest.raises(RigError, match=r"instead it is 1e-09|instead it is 0 "):
        axis.set(1.0)
    axis.close()


def test_an_answer_of_two_numbers_is_none():
    axis = Supply(answer="{:.4f} A 12.0 V").axis()
    with pytest.raises(RigError, match=r"must hold one number; .*12\.0 V"):
        axis.set(1.0)
    axis.close()


def test_a_supply_that_does_not_get_there_is_no_step():
    axis = Supply(sticks_at=0.7).axis()
    with pytest.raises(RigError, match=r"must become 1\.2 .* instead it is 0\.7"):
        axis.set(1.2)
    axis.close()


@pytest.mark.parametrize(
    "line",
    [
        "CURR {value!z}",
        "CURR {value:q}",
        "CURR {value.__class__}",
        "CURR {value} {other}",
        "CURR {value:999999999f}",
        "CURR {value",
        "CURR {value} {value}",
    ],
)
def test_a_line_that_could_not_be_sent_is_refused_when_the_file_is_read(line):
    with pytest.raises(ValueError, match=r"set_line must hold \{value\} once"):
        AxisConfig(name="current_A", port="COM3", min=0.0, max=2.0, set_line=line)


def test_rounding_takes_no_value_beyond_the_limits():
    axis = AxisConfig(
        name="current_A", port="COM3", min=0.0, max=1.6, set_line="CURR {value:.0f}"
    )
    assert why_not_set(axis, 1.4) == ""
    assert "writes 1.6 as 2" in why_not_set(axis, 1.6)
