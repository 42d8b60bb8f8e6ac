"""Faults on schedule: the rig file says what goes wrong on the twin, and when."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from magbend.core.errors import ConfigError
from magbend.rig.bench.config import read_plan, read_rig
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import RunSummary, run
from magbend.rig.runs.verify import verify_run
from magbend.rig.virtual.bench import open_twin

from .twin_run import render


def with_fault(plan_file: Path, *rows: str) -> Path:
    rig_file = plan_file.with_name("rig.toml")
    tables = "".join(f"\n[[twin.fault]]\n{row}\n" for row in rows)
    rig_file.write_text(rig_file.read_text() + tables)
    return plan_file


def run_twin(plan_file: Path, out: Path, *, resume: bool = False) -> RunSummary:
    plan = read_plan(plan_file)
    devices = open_twin(plan.rig, render, lambda gap: 38.0 * (70.0 / gap) ** 2)
    try:
        return run(plan, devices, out, resume=resume, twin=True)
    finally:
        devices.close()


# when and what; how the run ends, after how many steps, and what its reason says
ENDINGS = {
    'kind = "alarm 1"\nat_gap_mm = 75.0': ("fail", 0, "ALARM:1"),
    'kind = "alarm 2"\nat_step = 1\nafter_s = 0.2': ("fail", 1, "ALARM:2|stand"),
    'kind = "alarm 3"\nat_gap_mm = 65.0': ("fail", 1, "ALARM:3"),
    'kind = "alarm 8"\nat_s = 0.0': ("fail", 0, "ALARM:8"),
    'kind = "alarm 9"\nat_s = 0.0': ("fail", 0, "ALARM:9"),
    'kind = "restart"\nat_gap_mm = 65.0\nfor_s = 1.8': ("fail", 1, "restart"),
    'kind = "restart"\nat_step = 2\nafter_s = 0.5': ("fail", 2, "position|restart"),
    'kind = "unplug"\nat_gap_mm = 55.0': ("fail", 2, "link lost"),
    'kind = "silence"\nat_gap_mm = 65.0': ("fail", 1, "silent"),
    'kind = "silence"\nat_gap_mm = 65.0\nfor_s = 2.0': ("success", 3, "every"),
    'kind = "stall"\nat_gap_mm = 65.0': ("fail", 1, "reach"),
    'kind = "garbage"\nat_gap_mm = 65.0': ("success", 3, "every"),
    'kind = "torn line"\nat_gap_mm = 65.0': ("success", 3, "every"),
    'kind = "hold button"\nat_gap_mm = 65.0': ("fail", 1, "stop|reach"),
    'kind = "camera stall"\nat_step = 1': ("fail", 1, "twin camera"),
    'kind = "camera stall"\nat_s = 3.0\nfor_s = 1.0': ("success", 3, "every"),
}


@pytest.mark.parametrize("fault", ENDINGS)
def test_a_fault_strikes_at_its_moment_and_the_run_ends_by_name(
    fault: str, plan_file: Path, tmp_path: Path
) -> None:
    status, steps, reason = ENDINGS[fault]
    out = tmp_path / "out"
    summary = run_twin(with_fault(plan_file, fault), out)
    assert (summary.status, summary.steps_done) == (status, steps), summary.reason
    assert re.search(reason, summary.reason), summary.reason
    assert verify_run(out) == []
    kinds = [row["kind"] for row in read_run(out).manifest["twin_faults"]]
    assert kinds == [re.search('"(.*)"', fault)[1]]


@pytest.mark.parametrize(
    ("fault", "flags"),
    [
        (
            'kind = "meter overload"\nat_step = 1\nfor_s = 6.0',
            ["step 2: flux_overload"],
        ),
        ('kind = "meter silence"\nat_gap_mm = 52.0', ["step 3: flux_silent"]),
        ('kind = "camera dark"\nat_step = 2', ["step 3: brightness_drift"]),
    ],
)
def test_faults_of_meter_and_lamp_are_flags(
    fault: str, flags: list[str], plan_file: Path, tmp_path: Path
) -> None:
    summary = run_twin(with_fault(plan_file, fault), tmp_path / "out")
    assert (summary.status, list(summary.flagged)) == ("success", flags)


def test_a_run_is_resumed_once_the_schedule_is_empty(
    plan_file: Path, tmp_path: Path
) -> None:
    rig_file, out = plan_file.with_name("rig.toml"), tmp_path / "out"
    plain = rig_file.read_text()
    with_fault(plan_file, 'kind = "alarm 1"\nat_gap_mm = 65.0')
    assert run_twin(plan_file, out).steps_done == 1
    rig_file.write_text(plain)
    assert run_twin(plan_file, out, resume=True).status == "success"
    assert verify_run(out) == []


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ('kind = "alarm 1"', "one of at_s, at_step and at_gap_mm"),
        ('kind = "alarm 1"\nat_s = 1.0\nat_step = 1', "one of at_s, at_step"),
        ('kind = "flood"\nat_s = 1.0', "kind"),
        ('kind = "stall"\nat_s = -1.0', "at_s"),
        ('kind = "stall"\nat = 1.0', "unknown key"),
    ],
)
def test_a_wrong_schedule_is_one_sentence(row, sentence, plan_file: Path) -> None:
    rig_file = with_fault(plan_file, row).with_name("rig.toml")
    with pytest.raises(ConfigError, match=sentence) as refused:
        read_rig(rig_file)
    assert "\n" not in str(refused.value)
    assert "line" in str(refused.value)
