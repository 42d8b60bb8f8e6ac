"""Do the bounds of rods in space bound, and are their indices right? Random rods.

    python benchmarks/bench_bounds_3d.py [rods of each kind] [seed]

Rods of two sections at 1, 5 and 20 times the printed remanence, half of them magnetised
across their axis too, curved, with weight, clamped askew, in uniform fields of any
direction and before a cube off their plane. Each shape of `solve_spatial_many` is
solved again with eight times as many steps, and its unstable directions are counted
there without the short cut (`spatial.sure`) that spares most rods the count. Counts
tips missed by more than the bound, and indices or outcomes that differ. The same march,
so this is about steps; `tests/sim/test_spatial_random.py` holds rods against another.
"""

from __future__ import annotations

import sys

import numpy as np

from magbend.core.magnet import Magnet
from magbend.sim import Support, solve_spatial_many
from magbend.sim.batch.space import _fields, _rods
from magbend.sim.fields import before
from magbend.sim.spatial.index import morse_index
from magbend.sim.spatial.march import loads_on
from magbend.sim.spatial.newton import room, solve_pose
from magbend.sim.spatial.rod import clamp_of
from magbend.sim.spatial.rows import POINTS, _meets

CUBE = Magnet.cube(55.0, 1.305, elevation_deg=20.0, offset_mm=(5.0, 0.0, 8.0))
HELD = Support(gravity_m_s2=(1.0, -2.0, -9.5), clamp_angle_deg=15.0)


def draw(rng: np.random.Generator, n: int, times: float, *, cube: bool) -> dict:
    """Return `n` designs at so many times the printed remanence."""
    tilted = rng.random((n, 1)) < 0.5
    designs = {
        "length_mm": rng.uniform(8.0, 22.0, (n, 2)),
        "E_MPa": rng.uniform(5.0, 30.0, (n, 2)),
        "side_mm": rng.uniform(0.7, 1.3, n),
        "remanence_mT": times * rng.uniform(-25.0, 25.0, (n, 2)),
        "remanence_y_mT": times * tilted * rng.uniform(-10.0, 10.0, (n, 2)),
        "remanence_z_mT": times * tilted * rng.uniform(-10.0, 10.0, (n, 2)),
        "natural_curvature_per_mm": rng.uniform(-0.02, 0.02, (n, 1)) * np.ones((n, 2)),
        "density_kg_m3": rng.uniform(1000.0, 3000.0, n),
    }
    if cube:
        return designs | {"gap_mm": rng.uniform(25.0, 90.0, n)}
    return designs | {
        "flux_mT": rng.uniform(5.0, 70.0, n),
        "angle_deg": rng.uniform(-180.0, 180.0, n),
        "elevation_deg": rng.uniform(-60.0, 60.0, n),
    }


def check(designs: dict, magnet: Magnet | None) -> tuple[np.ndarray, list[str]]:
    """Return counts: stable, unstable, gone; bounds broken, indices, outcomes off.

    And a line for each rod that is off.
    """
    off = []
    found = solve_spatial_many(designs, magnet=magnet, support=HELD)
    sizes = {k: v[:, None] if k == "side_mm" else v for k, v in designs.items()}
    rods, total_mm, margins = _rods(sizes, HELD, 0.49)
    fields = _fields(designs, None if magnet is None else before(magnet), total_mm)
    clamp, counts = clamp_of(HELD), np.zeros(6, dtype=int)
    R, r = np.empty((3, 3)), np.empty(3)
    room_s = np.linspace(0.0, 1.0, POINTS), np.empty((POINTS, 21))
    for i, one in enumerate(found):
        counts[min(one["outcome"], 2)] += 1
        if one["outcome"] > 2:
            continue
        reach, turn = loads_on(rods[i], fields[i], clamp[:, 2])
        n = 8.0 * (1.7 + 3.0 * reach + 1.4 * turn)
        held = room(rods[i], fields[i], 2.0 * n)
        index, _, _ = solve_pose(rods[i], fields[i], n, clamp, R, r, 1e-9, held)
        if index >= 0 and _meets(
            rods[i], fields[i], margins[i], 2 * n, held[1], *room_s
        ):
            index = -1
        if (index < 0) != (one["outcome"] == 2):
            counts[5] += 1
            off.append(f"rod {i}: outcome {one['outcome']}, by more steps {index}")
        elif index >= 0:
            tip = np.array([one[f"tip_{axis}_mm"] for axis in "xyz"])
            miss_mm = np.abs(r * total_mm[i] - tip).max()
            counts[3] += miss_mm > one["error_mm"]
            true = morse_index(rods[i], fields[i], 1.0, n, R, r)
            counts[4] += true != one["morse_index"]
            if true != one["morse_index"] or miss_mm > one["error_mm"]:
                off.append(
                    f"rod {i}: index {one['morse_index']}, by more steps {true}; tip "
                    f"off by {miss_mm:.1e} mm, bound {one['error_mm']:.1e} mm"
                )
    return counts, off


def main() -> None:
    """Print a row a kind."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 77)
    print("remanence  field     stable unstable  gone | bounds  indices outcomes off")
    for times in (1.0, 5.0, 20.0):
        for cube in (False, True):
            designs = draw(rng, n, times, cube=cube)
            counts, off = check(designs, CUBE if cube else None)
            print(
                f"{times:6.0f} x   {'cube' if cube else 'uniform':8} "
                + "{:7d} {:8d} {:5d} | {:6d} {:8d} {:8d}".format(*counts),
                *(f"    {line}" for line in off), sep="\n", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
