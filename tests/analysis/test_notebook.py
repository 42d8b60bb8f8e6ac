"""Results answer a notebook: a table, a plot into axes of one's own, and a look."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from analysis_factory import write_run
from matplotlib.figure import Figure

from magbend.analysis import compare_run, fit_runs, load_run
from magbend.analysis.design import goals, search
from magbend.analysis.design.makeable import Makeable
from magbend.sim import UniformField, gmc, solve


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    mpl.use("Agg")
    run = load_run(write_run(tmp_path_factory.mktemp("runs") / "gmc2", sigma_mm=0.01))
    (design, *_) = search.find_designs(
        goals.angle_goal(12.0), UniformField(flux_mT=50.0), Makeable(), count=1
    )
    return {
        "run": run,
        "solution": solve(gmc(2), UniformField(flux_mT=50.0)),
        "comparison": compare_run(run),
        "fit": fit_runs([run]),
        "design": design,
    }


KINDS = ("run", "solution", "comparison", "fit", "design")


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_a_table_a_plot_and_html(results, kind):
    result = results[kind]
    table = result.to_dataframe()
    assert len(table)
    axes = Figure().subplots()
    assert result.plot(axes) is axes
    assert axes.has_data()
    assert axes.get_xlabel()
    assert axes.get_ylabel()
    html = result._repr_html_()
    assert "<table" in html
    assert len(html) < 30_000


def test_new_axes_are_made_where_none_are_given(results):
    axes = results["solution"].plot()
    line = results["solution"].centreline
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), line.y_mm)
    mpl.pyplot.close(axes.figure)


def test_a_name_in_a_run_is_text_not_markup(results, tmp_path):
    from dataclasses import replace

    run = replace(results["run"], name="<script>x</script>")
    assert "<script>" not in run._repr_html_()


def test_tables_hold_what_the_result_holds(results):
    fit = results["fit"].to_dataframe()
    assert list(fit["parameter"][:3]) == ["E_MPa[0]", "E_MPa[1]", "E_MPa[2]"]
    np.testing.assert_array_equal(fit["value"], results["fit"].values)
    comparison = results["comparison"].to_dataframe()
    assert set(comparison["model"]) == {"uniform", "magnet"}
    design = results["design"].to_dataframe().iloc[0]
    assert design["tip_angle_deg"] == pytest.approx(12.0, rel=0.01)
