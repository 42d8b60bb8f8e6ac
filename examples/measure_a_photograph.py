"""From a photograph to millimetres: calibrate on a board, then measure the rod.

python examples/measure_a_photograph.py [folder]
"""

from __future__ import annotations

import sys
from importlib import resources
from pathlib import Path

import matplotlib.pyplot as plt

from magbend.vision import Board, Measurement, calibrate, extract, read_photo

PHOTOGRAPHS = Path(str(resources.files("magbend.examples"))) / "photographs"
ROD, AXIS_HEIGHT_MM = PHOTOGRAPHS / "dev_10.jpg", 0.9


def main(folder: Path) -> Measurement:
    """Draw the centreline over its photograph; return the measurement."""
    camera = calibrate(
        read_photo(PHOTOGRAPHS / "calib_D.jpg"),
        board=Board(),
        rod_height_mm=AXIS_HEIGHT_MM,
    )
    measured = extract(read_photo(ROD), camera)
    figure, axes = plt.subplots(figsize=(6.0, 4.5), layout="constrained")
    axes.imshow(plt.imread(ROD))
    axes.plot(*measured.points_px.T, color="tab:red", linewidth=1.0)
    axes.set_axis_off()
    figure.savefig(folder / "measure_a_photograph.png", dpi=150)
    plt.close(figure)
    return measured


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    found = main(out)
    x_mm, y_mm = found.tip_mm
    print(f"tip ({x_mm:.3f}, {y_mm:.3f}) mm, length {found.length_mm:.3f} mm")
    print(f"direction at the clamp known to {found.clamp_angle_sd_deg:.2f} deg")
    print(f"doubts: {', '.join(found.flags) or 'none'}")
