"""The library: build rate, memory and query times at 10^5, 10^6, 10^7 designs.

Run by hand: python benchmarks/bench_library.py [largest exponent] [folder]. The peer of
the queries is pandas on the same files, where they fit into memory (up to 10^6).
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

from magbend.analysis.library.query import query
from magbend.analysis.library.space import Space
from magbend.sim import UniformField, gmc, solve

WHERE = "tip_y_mm > 4 and side_mm < 1"
BUILD = """
import resource, sys, time
from pathlib import Path
from bench_library import space
from magbend.analysis.library.build import build
start = time.perf_counter()
build(space(int(sys.argv[1])), Path(sys.argv[2]))
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_SELF)
print(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3)
"""


def space(designs: int) -> Space:
    section = {
        "length_mm": {"from": 5.0, "to": 20.0},
        "E_MPa": {"from": 6.0, "to": 48.0},
    }
    return Space.model_validate(
        {
            "name": "bench",
            "method": "sobol",
            "designs": designs,
            "side_mm": {"from": 0.75, "to": 1.35},
            "remanence_mT": {"from": 14.0, "to": 26.0},
            "flux_mT": {"from": 10.0, "to": 120.0},
            "section": [section] * 3,
        }
    )


def timed(name: str, call) -> None:
    times = []
    for _ in range(3):
        start = time.perf_counter()
        found = call()
        times.append(time.perf_counter() - start)
    print(f"  {name:34s}{min(times):7.3f} s  {found}")


def main(largest: int, folder: Path) -> None:
    line = solve(gmc(2), UniformField(flux_mT=50.0)).centreline
    for exponent in range(5, largest + 1):
        out = folder / f"library{exponent}"
        arguments = [sys.executable, "-c", BUILD, str(10**exponent), str(out)]
        text = subprocess.run(
            arguments, check=True, capture_output=True, text=True,
            cwd=Path(__file__).parent,
        ).stdout  # fmt: skip
        wall, cpu, rss = map(float, text.split())
        size = sum(path.stat().st_size for path in out.iterdir()) / 1e6
        print(
            f"10^{exponent}: {wall:.1f} s, {cpu:.1f} s of processor time, "
            f"{10**exponent / wall:.0f} designs/s, peak {rss:.0f} MB, {size:.0f} MB"
        )
        timed("condition, first 20", lambda out=out: query(out, where=WHERE).matched)
        timed(
            "condition, sorted, top 20",
            lambda out=out: query(out, where=WHERE, sort="-circularity").matched,
        )
        timed("nearest shape, top 20", lambda out=out: query(out, nearest=line).matched)
        if exponent <= 6:
            timed(
                "the same condition, pandas",
                lambda out=out: len(
                    pd.read_parquet(out, columns=["tip_y_mm", "side_mm"]).query(WHERE)
                ),
            )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"peak of this process with all queries: {peak:.0f} MB")


if __name__ == "__main__":
    top = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    if len(sys.argv) > 2:
        main(top, Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(top, Path(temporary))
