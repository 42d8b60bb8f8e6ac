"""The surrogate: the honest table, and the coverage of its error bar.

Run by hand: python benchmarks/bench_surrogate.py [designs]
"""

from __future__ import annotations

import sys

import numpy as np

from magbend.analysis.surrogate import model as surrogate
from magbend.analysis.surrogate.compare import compare
from magbend.analysis.surrogate.fit import deviations, draw


def main(designs: int) -> None:
    model = surrogate.load()
    print(f"{'':22s}{'RMS mm':>10s}{'tip mm':>10s}{'us':>10s}{'kB':>8s}")
    for row in compare(model, designs=designs):
        print(
            f"{row.name:22s}{row.rms_mm:10.2g}{row.worst_tip_mm:10.2g}"
            f"{row.time_us:10.3g}{row.size_kB:8.3g}"
        )
    for seed in (101, 102, 103):
        away, predicted = deviations(model, draw(32_768, seed))
        inside = predicted.inside
        covered = (away.max(axis=1) <= predicted.error_mm)[inside].mean()
        rms = np.sqrt(np.mean(away**2))
        print(
            f"32768 unseen designs: {rms:.2e} mm RMS (goal 5e-4), worst tip "
            f"{away[:, -1].max():.4f} mm (goal 0.03), bar covers {covered:.1%} (95 %)"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 4096)
