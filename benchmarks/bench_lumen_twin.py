"""How well a rod in a printed channel is measured, how often its contacts are right.

python benchmarks/bench_lumen_twin.py [--seeds 100-111]

Every seed is another channel, rod, gap and bench, drawn and never chosen; the rod is
fed in by steps of 4 mm, photographed by the twin and measured as `magbend analysis
lumen` does. The truth is the shape and the contacts of the rod that was photographed.
A contact is found if it is flagged within 1 mm along the rod on the same wall; a flag
is false if no force acts within 1 mm of it, and then the true gap there is told.
"""

from __future__ import annotations

import argparse
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from magbend.analysis.lumen.contacts import HOLE_MM, Fed, fed
from magbend.analysis.lumen.place import place
from magbend.analysis.twin.lumen_bench import LumenBench
from magbend.core.magnet import Magnet
from magbend.sim import gmc
from magbend.sim.navigate import Lumen, channel
from magbend.vision import Measurement, Setting, as_photo, calibrate, measure

STEPS_MM = np.arange(12.0, 29.0, 4.0)


class Count(NamedTuple):
    """What one photograph gave; lengths in mm."""

    rms: float
    worst: float
    gap_z: float
    pressed: int
    found: int
    false: int
    false_gaps: tuple[float, ...]


def drawn(rng: np.random.Generator, side_mm: float) -> Lumen:
    """Return a channel of four legs that nobody chose."""
    legs = [(float(rng.uniform(4.0, 8.0)), 0.0)]
    legs += [
        (float(rng.uniform(8.0, 14.0)), float(rng.uniform(-70.0, 70.0)))
        for _ in range(3)
    ]
    width_mm = side_mm * float(rng.uniform(1.8, 3.5))
    return channel("drawn", width_mm=width_mm, legs=legs)


def edges_of(found: Measurement) -> np.ndarray:
    """Return the edges as the edge table holds them."""
    return np.vstack(
        [
            np.column_stack(
                [np.full(121, k), np.arange(121)]
                + [found.points[f"{side}_{axis}_px"] for axis in "xy"]
            )
            for k, side in enumerate(("left", "right"))
        ]
    )


def judged(bench: LumenBench, gap_mm: float, seen: Fed) -> Count:
    """Hold a measured rod against the one that was photographed."""
    true = bench.resting(gap_mm)
    inside = seen.s_mm > 0.0
    s = seen.s_mm[inside]
    x, y, theta = (np.interp(s, true.s_mm, row) for row in true.shape[:3])
    dx, dy = seen.points_mm[inside].T - np.array([x, y])
    off = np.cos(theta) * dy - np.sin(theta) * dx
    rooms = bench.lumen.rooms_mm(np.column_stack([x, y]))
    half_mm = 0.5 * bench.specimen.side_mm
    gap = np.min(list(rooms.values()), axis=0) - half_mm
    z = (seen.gap_mm[inside] - gap) / seen.sigma_mm[inside]
    near = [
        [
            t.wall == c.wall and t.from_mm - HOLE_MM < c.s_mm < t.to_mm + HOLE_MM
            for t in seen.touches
        ]
        for c in true.contacts
    ]
    false = [
        k for k in range(len(seen.touches)) if not any(row[k] for row in near)
    ]  # fmt: skip
    at = [float(np.interp(seen.touches[k].at_mm, s, gap)) for k in false]
    return Count(
        rms=float(np.sqrt(np.mean(off**2))),
        worst=float(np.abs(off).max()),
        gap_z=float(np.sqrt(np.mean(z**2))),
        pressed=len(near),
        found=sum(any(row) for row in near),
        false=len(false),
        false_gaps=tuple(at),
    )


def one(seed: int) -> tuple[list[Count], int, float]:
    """Return the counts of a seed, how many photographs failed, and place error."""
    rng = np.random.default_rng(seed)
    rod = gmc(int(rng.integers(1, 8)))
    lumen = drawn(rng, rod.side_mm)
    gap_mm = float(rng.uniform(60.0, 110.0))
    height_mm = 0.4 + rod.side_mm
    bench = LumenBench(
        rod, Magnet.cube(55.0, 1.305), lumen, seed=seed, wall_height_mm=height_mm
    )
    feed = SimpleNamespace(value=None)
    bench.axes = {"insertion_mm": feed}
    stills = bench.stills()
    camera = calibrate(
        as_photo(stills["board.png"]), board=bench.board,
        rod_height_mm=bench.axis_height_mm,
    )  # fmt: skip
    placed, setting = place(
        lumen, as_photo(stills["bare.png"]), camera, wall_height_mm=height_mm,
        setting=Setting(calibration=camera, joints_mm=rod.joints_mm),
        side_mm=rod.side_mm,
    )  # fmt: skip
    dx, dy = placed.pose.x_mm - bench.pose.x_mm, placed.pose.y_mm - bench.pose.y_mm
    counts, failed = [], 0
    for fed_mm in STEPS_MM:
        feed.value = float(fed_mm)
        found = measure(as_photo(bench.photograph(gap_mm, 0.0)), setting)
        if not found.ok:
            print(f"  seed {seed}, {fed_mm:g} mm: {found.reason}")
            failed += 1
            continue
        seen = fed(
            found.points, edges_of(found), lumen, placed, camera,
            axis_height_mm=bench.axis_height_mm, wall_sd_mm=0.0,
        )  # fmt: skip
        counts.append(judged(bench, gap_mm, seen))
    return counts, failed, float(np.hypot(dx, dy))


def main() -> None:
    """Print a row a seed, and the sum."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", default="100-111")
    first, last = map(int, parser.parse_args().seeds.split("-"))
    counts: list[Count] = []
    failed, places = 0, []
    for seed in range(first, last + 1):
        here, lost, place_mm = one(seed)
        counts += here
        failed += lost
        places.append(place_mm)
        if here:
            print(
                f"seed {seed}: place off by {1e3 * place_mm:.0f} um, axis RMS "
                f"{1e3 * np.median([c.rms for c in here]):.1f} um, contacts "
                f"{sum(c.found for c in here)} of {sum(c.pressed for c in here)}, "
                f"{sum(c.false for c in here)} false"
            )
    pressed, found = sum(c.pressed for c in counts), sum(c.found for c in counts)
    false = sum(c.false for c in counts)
    gaps = [gap for c in counts for gap in c.false_gaps]
    print(
        f"{len(counts)} photographs, {failed} not measured; place of the channel "
        f"{1e3 * np.median(places):.0f} um (worst {1e3 * max(places):.0f}); axis RMS "
        f"{1e3 * np.median([c.rms for c in counts]):.1f} um in the middle of all, "
        f"{1e3 * max(c.worst for c in counts):.0f} um at worst"
    )
    print(
        f"contacts: {found} of {pressed} found ({100.0 * found / pressed:.0f} %), "
        f"{false} false flags ({100.0 * false / (found + false):.0f} % of all); true "
        f"gaps there {1e3 * np.median(gaps) if gaps else 0.0:.0f} um (median), "
        f"{1e3 * max(gaps, default=0.0):.0f} um at most; gap errors over their "
        f"deviation: RMS {np.sqrt(np.mean([c.gap_z**2 for c in counts])):.2f}"
    )


if __name__ == "__main__":
    main()
