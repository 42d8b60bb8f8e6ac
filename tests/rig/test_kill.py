"""kill -9 at random moments, Ctrl-C in every phase: nothing lost, nothing doubled."""

from __future__ import annotations

import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from magbend.rig.runs.read import is_run, read_run
from magbend.rig.runs.verify import verify_run

SCRIPT = Path(__file__).with_name("twin_run.py")
GAPS_MM = [140.0 - 8.0 * index for index in range(12)]

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")


def start(plan: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    """Start a run and return once its imports are done."""
    process = subprocess.Popen(
        [sys.executable, str(SCRIPT), str(plan), str(out), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    return process


def with_gaps(plan_file: Path) -> Path:
    text = re.sub(r"gaps_mm = .*", f"gaps_mm = {GAPS_MM}", plan_file.read_text())
    plan_file.write_text(text)
    return plan_file


def check(out: Path, before: list[dict]) -> list[dict]:
    """Assert that what was recorded is still there, once, whole; return the records."""
    if not is_run(out):
        assert not before
        return []
    steps = list(read_run(out).steps)
    assert steps[: len(before)] == before, "a finished step was lost or changed"
    assert [step["index"] for step in steps] == list(range(len(steps)))
    # A kill between photograph and record leaves a photograph, which is named.
    problems = [p for p in verify_run(out) if f"step_{len(steps):03d}.png" not in p]
    assert problems == []
    return steps


def kill_until(plan: Path, folder: Path, kills: int, seed: int) -> dict[str, int]:
    generator = random.Random(seed)
    counts = {"kills": 0, "runs": 0, "steps": 0, "before run.json": 0}
    while counts["kills"] < kills:
        out = folder / f"run{counts['runs']}"
        steps: list[dict] = []
        while counts["kills"] < kills:
            with start(plan, out, "--resume") as process:
                try:
                    process.wait(generator.uniform(0.0, 1.0))
                    break
                except subprocess.TimeoutExpired:
                    process.send_signal(signal.SIGKILL)
            counts["kills"] += 1
            counts["before run.json"] += not is_run(out)
            steps = check(out, steps)
        if not is_run(out) or not read_run(out).is_finished:
            with start(plan, out, "--resume") as process:
                output = process.communicate(timeout=60)[0]
            assert process.returncode == 0, output
        steps = check(out, steps)
        assert [step["gap_mm"] for step in steps] == GAPS_MM
        assert read_run(out).is_finished
        counts["runs"] += 1
        counts["steps"] += len(steps)
    return counts


@posix_only
def test_six_kills_lose_nothing(plan_file: Path, tmp_path: Path) -> None:
    counts = kill_until(with_gaps(plan_file), tmp_path, 6, seed=1)
    print(f"kill -9: {counts}; lost 0, doubled 0, altered 0")


@posix_only
@pytest.mark.slow
def test_a_hundred_kills_lose_nothing(plan_file: Path, tmp_path: Path) -> None:
    counts = kill_until(with_gaps(plan_file), tmp_path, 100, seed=2)
    print(f"kill -9: {counts}; lost 0, doubled 0, altered 0")
    assert counts["kills"] == 100


def interrupt(
    plan: Path, out: Path, delay_s: float, number: int, *, line: str = ""
) -> tuple[int, float]:
    """Signal a run `delay_s` after it printed `line`; return exit code and seconds."""
    with start(plan, out, "--speed", "5") as process:
        while line and not process.stdout.readline().startswith(line):
            pass
        time.sleep(delay_s)
        asked_s = time.monotonic()
        process.send_signal(number)
        process.communicate(timeout=20)
        return process.returncode, time.monotonic() - asked_s


@posix_only
@pytest.mark.parametrize(
    ("phase", "line", "delay_s", "number"),
    [
        ("homing", "homing", 0.1, signal.SIGINT),
        ("moving", "step 1 of", 0.1, signal.SIGINT),
        ("moving", "step 1 of", 0.1, signal.SIGTERM),
        ("settling", "step 1 of", 0.3, signal.SIGINT),
        ("photographing", "step 1 of", 0.45, signal.SIGINT),
    ],
)
def test_interrupts_end_the_run_in_three_seconds(
    plan_file: Path,
    tmp_path: Path,
    phase: str,
    line: str,
    delay_s: float,
    number: signal.Signals,
) -> None:
    out = tmp_path / "out"
    code, took_s = interrupt(with_gaps(plan_file), out, delay_s, number, line=line)
    assert code == 1
    assert took_s < 3.0
    assert read_run(out).status == "abort"
    assert verify_run(out) == []
    print(f"{number.name} while {phase}: ended as abort in {took_s:.2f} s")


@posix_only
@pytest.mark.slow
def test_two_hundred_interrupts_all_leave_an_ending(
    plan_file: Path, tmp_path: Path
) -> None:
    plan = with_gaps(plan_file)
    generator = random.Random(3)
    ended, slowest_s = 0, 0.0
    for index in range(200):
        out = tmp_path / f"run{index}"
        number = generator.choice([signal.SIGINT, signal.SIGTERM])
        delay_s = generator.uniform(0.0, 1.2)
        line = generator.choice(["homing", "step 1 of", "step 2 of"])
        code, took_s = interrupt(plan, out, delay_s, number, line=line)
        assert (code, read_run(out).status) == (1, "abort"), (index, number, delay_s)
        assert verify_run(out) == []
        ended, slowest_s = ended + 1, max(slowest_s, took_s)
    print(f"interrupts: {ended} of 200 ended as abort, slowest in {slowest_s:.2f} s")
    assert slowest_s < 3.0
