"""Figures a journal takes: one style, any width, the numbers beside each."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from analysis_factory import write_run
from matplotlib.text import Text
from typer.testing import CliRunner

from magbend.analysis import compare_run, load_run
from magbend.analysis.figures.bench import bench_figure
from magbend.analysis.figures.run import draw_shapes, field_figure, shapes_figure
from magbend.analysis.figures.several import gmc_numbers, paper_figure
from magbend.analysis.figures.style import drawing, new_panels
from magbend.analysis.figures.write import figure_csv
from magbend.cli.main import app
from magbend.core.errors import InputError
from magbend.sim import gmc


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "gmc2"
    return compare_run(load_run(write_run(path, sigma_mm=0.02)))


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def test_every_figure_is_written_at_its_width_with_its_numbers(run, tmp_path):
    answer = CliRunner().invoke(
        app,
        ["analysis", "figures", str(run.run.path), "--no-fit", "--width-mm", "88",
         "--out", str(tmp_path), "--json"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    files = [Path(file) for file in json.loads(answer.stdout)["files"]]
    names = {path.stem for path in files}
    assert names == {"bench", "shapes", "residuals", "field", "methods"}
    svg = (tmp_path / "shapes.svg").read_text()
    width_pt = float(re.search(r'<svg[^>]*width="([\d.]+)pt"', svg).group(1))
    assert width_pt == pytest.approx(88.0 / 25.4 * 72.0, rel=1e-3)
    assert "<text" in svg  # letters stay letters
    assert "95 %" in (tmp_path / "methods.txt").read_text()
    for path in files:
        assert path.stat().st_size
        if path.suffix == ".csv" and path.stem != "bench":
            assert len(rows(path.read_text())) > 3, path


def test_the_numbers_of_a_figure_are_those_that_were_compared(run):
    table = rows(figure_csv(shapes_figure(run)))
    frame = run.run.frame(run.run.steps[0])
    line = frame.centreline
    name = f"measured, {run.run.steps[0].flux_mT:.3g} mT"
    mine = [row for row in table if row["series"] == name]
    x = np.array([float(row["x"]) for row in mine])
    assert np.isin(np.round(x, 6), np.round(line.x_mm, 6)).all()
    # Error bars: 95 % of the stated sigma, across the line.
    error = np.array([float(row["y_error"]) for row in mine])
    across = 1.96 * 0.02 * np.abs(np.cos(line.theta_rad[:: max(1, len(x) // 30)]))
    np.testing.assert_allclose(error[0], across[0], rtol=1e-3)
    assert {row["x_name"] for row in table} == {"x along the undeformed rod (mm)"}


def test_readings_carry_the_error_bars_of_the_meter(run):
    table = rows(figure_csv(field_figure(run)))
    readings = [row for row in table if row["series"] == "reading"]
    assert len(readings) == 3
    assert float(readings[0]["y_error"]) == pytest.approx(1.96 * 0.05, rel=1e-3)


def test_in_the_papers_figure_dots_and_line_of_a_rod_share_a_colour(run):
    runs = [
        replace(run, run=replace(run.run, specimen=replace(gmc(n), name=f"GMC {n}")))
        for n in range(1, 8)
    ]
    figure = paper_figure(gmc_numbers(runs))
    assert len(figure.axes) == 9
    for axes in figure.axes:
        by_name: dict[str, set[str]] = {}
        for line in axes.lines:
            name = str(line.get_gid() or line.get_label()).split(",")[0]
            if not name.startswith("_"):
                by_name.setdefault(name, set()).add(line.get_color())
        assert len(by_name) == 3
        assert all(len(colours) == 1 for colours in by_name.values())
        assert len(set.union(*by_name.values())) == 3


def test_axes_of_ones_own_are_drawn_into(run):
    with drawing():
        _, (axes,) = new_panels(1, height_mm=60.0, width_mm=88.0)
        draw_shapes(axes, run)
    assert len(axes.lines) > 6


def test_the_bench_is_drawn_to_scale(run):
    axes = bench_figure(run).axes[0]
    magnet = np.vstack([patch.get_xy() for patch in axes.patches[1:]])
    assert np.ptp(magnet[:, 0]) == pytest.approx(55.0)
    assert magnet[:, 1].max() == pytest.approx(-50.0)  # the gap from the rod's line
    assert axes.get_aspect() == 1.0


def test_without_a_magnet_there_is_no_bench_and_no_field(run):
    bare = replace(run, magnet=None, magnet_fit=None)
    assert bench_figure(bare) is None
    assert field_figure(bare) is None


def test_a_width_no_page_has_is_refused(run):
    with pytest.raises(InputError, match="width of a figure must be from 60 to 400 mm"):
        shapes_figure(run, width_mm=8.8)


def test_names_at_tips_close_together_do_not_overlap(tmp_path):
    path = write_run(tmp_path / "near", gaps_mm=(70.0, 69.0, 68.0, 60.0))
    near = compare_run(load_run(path))
    figure = shapes_figure(near, width_mm=88.0)
    figure.draw_without_rendering()
    names = [text for text in figure.axes[0].texts if text.get_text().endswith("mT")]
    boxes = sorted((Text.get_window_extent(name) for name in names), key=lambda b: b.y0)
    assert len(boxes) == 4
    for below, above in pairwise(boxes):
        assert above.y0 > below.y1 - 1.0
    assert max(box.x1 for box in boxes) < figure.bbox.x1
