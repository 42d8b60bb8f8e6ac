"""The expansion model: test error of every seed of every split, and training time.

Run by hand: python benchmarks/bench_expansion.py [seeds]. The named peer is the
published figure, 2.089e-7, taken as 1/mm^2.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from magbend.analysis.expansion.train import PUBLISHED_MSE_PER_MM2, train


def main(seeds: int) -> None:
    start, start_cpu = time.perf_counter(), time.process_time()
    report = train(seeds=seeds)
    wall, cpu = time.perf_counter() - start, time.process_time() - start_cpu
    for split, errors in report.test_mse_per_mm2.items():
        ratio = np.median(errors) / PUBLISHED_MSE_PER_MM2
        print(
            f"{split:10s} median {np.median(errors):.2e}, worst {errors.max():.2e} "
            f"1/mm^2; median over the published {ratio:.3g}; "
            f"tip {np.median(report.tip_error_mm[split]):.2g} mm"
        )
    print(f"{3 * seeds + 1} trainings: {wall:.0f} s, {cpu:.0f} s of processor time")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
