"""Run a plan on the twin with tiny pictures: what the tests kill and interrupt.

Usage: twin_run.py PLAN OUT [--resume] [--speed N]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from magbend.cli.keys import terminating
from magbend.rig.bench.config import read_plan
from magbend.rig.clock import SteppedClock
from magbend.rig.runs.runner import run
from magbend.rig.virtual.bench import open_twin
from magbend.rig.wire_log import WireLog

GENERATOR = np.random.default_rng(8)
NOISE = GENERATOR.normal(0.0, 1.5, (8, 96, 128))


def render(gap_mm: float, time_s: float) -> np.ndarray:
    """A dark bar on noisy paper, at a row that depends on the gap."""
    cover = np.clip(4.5 - np.abs(np.arange(96)[:, None] - gap_mm + 20.0), 0.0, 1.0)
    image = 210.0 - 170.0 * cover + NOISE[int(time_s * 1000.0) % len(NOISE)]
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def main() -> int:
    plan = read_plan(Path(sys.argv[1]))
    out = Path(sys.argv[2])
    has_speed = "--speed" in sys.argv
    speed = float(sys.argv[sys.argv.index("--speed") + 1]) if has_speed else None
    clock = SteppedClock(speed=speed)
    log = WireLog(None, clock)
    print("ready", flush=True)
    with terminating():
        devices = open_twin(
            plan.rig, render, lambda gap: 38.0 * (70.0 / gap) ** 2, clock=clock, log=log
        )
        summary = run(
            plan,
            devices,
            out,
            resume="--resume" in sys.argv,
            twin=True,
            report=lambda line: print(line, flush=True),
        )
        devices.close()
    print(summary.status, summary.reason, flush=True)
    return 0 if summary.status == "success" else 1


if __name__ == "__main__":
    raise SystemExit(main())
