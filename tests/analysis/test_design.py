"""Design backwards: goals hit, limits kept, each design solved again by itself."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.analysis.compare.metrics import fit_circle
from magbend.analysis.design import goals
from magbend.analysis.design.makeable import (
    PAPER_RECIPES,
    PAPER_SIDES_MM,
    Candidates,
    Makeable,
    designs_in,
    dimension,
    rods,
    scattered,
)
from magbend.analysis.design.path import read_path
from magbend.analysis.design.search import design_all, find_designs
from magbend.cli.main import app
from magbend.core.errors import ConfigError, InputError, SolverError
from magbend.core.magnet import Magnet
from magbend.core.specimen_file import read_specimen
from magbend.sim import MagnetField, UniformField, gmc, solve
from magbend.sim.batch.shapes import solve_shapes

FIELD = UniformField(flux_mT=50.0)
FREE = Makeable()


def radius_of(specimen, field) -> float:
    return fit_circle(solve(specimen, field).centreline.points_mm).radius_mm


def assert_makeable(specimen, limits: Makeable) -> None:
    E = [section.E_MPa for section in specimen.sections]
    lengths = [section.length_mm for section in specimen.sections]
    assert np.all(np.diff(E) <= 0.0)
    assert limits.E_MPa[0] - 1e-3 <= E[-1]
    assert limits.E_MPa[1] + 1e-3 >= E[0]
    assert min(lengths) >= limits.unit_length_mm[0] - 1e-3
    assert max(lengths) <= limits.unit_length_mm[1] + 1e-3
    assert sum(lengths) == pytest.approx(limits.total_length_mm[0], abs=2e-3)
    assert limits.side_mm[0] - 1e-4 <= specimen.side_mm <= limits.side_mm[1] + 1e-4


def test_random_reachable_radii_are_hit_by_several_designs():
    rng = np.random.default_rng(7)
    for _ in range(6):
        z = rng.random((1, dimension(FREE)))
        made = rods(FREE, Candidates(z=z, choice=np.zeros(1, dtype=np.int64)))
        field = UniformField(flux_mT=float(rng.uniform(10.0, 120.0)))
        shape = solve_shapes(designs_in(made, field)).points
        wanted = float(goals.achieved(goals.radius_goal(1.0), shape)[0])
        found = find_designs(goals.radius_goal(wanted), field, FREE, count=5)
        assert len(found) >= 3
        for one in found:
            assert radius_of(one.specimen, field) == pytest.approx(wanted, rel=5e-3)
            assert one.achieved == pytest.approx(radius_of(one.specimen, field))
            assert_makeable(one.specimen, FREE)


def test_designs_are_distinct_and_ranked():
    found = find_designs(goals.radius_goal(100.0), FIELD, FREE, count=5)
    assert len(found) == 5
    for i, one in enumerate(found):
        for other in found[:i]:
            pairs = zip(one.specimen.sections, other.specimen.sections, strict=True)
            length, E = np.array(
                [(a.length_mm - b.length_mm, a.E_MPa / b.E_MPa) for a, b in pairs]
            ).T
            side = one.specimen.side_mm / other.specimen.side_mm
            assert (
                np.abs(length).max() > 0.5
                or np.abs(np.log(E)).max() > 0.05
                or abs(np.log(side)) > 0.02
            )
    # Told by rods that did not decide the rank, so that the first is not flattered.
    tolerances = np.array([one.tolerance for one in found])
    assert np.all(tolerances[1:] > 0.95 * tolerances[:-1])


def test_the_tolerance_is_that_of_made_rods():
    one = find_designs(goals.radius_goal(100.0), FIELD, FREE, count=1)[0]
    rng = np.random.default_rng(11)
    made = scattered(one.specimen, FREE.scatter, 2000, rng)
    shapes = solve_shapes(designs_in(made, FIELD)).points
    low, high = np.quantile(
        goals.achieved(goals.radius_goal(1.0), shapes), [0.025, 0.975]
    )
    assert one.tolerance == pytest.approx((high - low) / 2.0, rel=0.2)
    exact = FREE.model_copy(
        update={
            "scatter": FREE.scatter.model_copy(
                update=dict.fromkeys(type(FREE.scatter).model_fields, 0.0)
            )
        }
    )
    perfect = find_designs(goals.radius_goal(100.0), FIELD, exact, count=1)[0]
    assert perfect.tolerance < 1e-6


def test_what_cannot_be_reached_says_how_near_and_why():
    with pytest.raises(SolverError) as error:
        find_designs(goals.radius_goal(10.0), UniformField(flux_mT=20.0), FREE)
    sentence = str(error.value)
    assert "the nearest is 82.6 mm" in sentence.replace("82.59", "82.6")
    assert "side_mm at its lower limit 0.75 mm" in sentence
    assert "E_MPa of section 3 at its lower limit 8 MPa" in sentence
    assert "total_length_mm fixed at 30 mm" in sentence


@pytest.mark.parametrize("angle_deg", [0.0, 180.0, -360.0])
@pytest.mark.parametrize("goal", [goals.radius_goal(100.0), goals.angle_goal(5.0)])
def test_a_field_along_the_rod_is_told_to_bend_nothing(goal, angle_deg):
    with pytest.raises(InputError, match="along the rod and does not bend it"):
        find_designs(goal, UniformField(flux_mT=50.0, angle_deg=angle_deg), FREE)


def test_recipes_and_moulds_of_the_paper():
    limits = Makeable(recipe=list(PAPER_RECIPES), sides_mm=list(PAPER_SIDES_MM))
    found = find_designs(goals.angle_goal(20.0), FIELD, limits, count=3)
    known = [recipe.E_MPa for recipe in PAPER_RECIPES]
    for one in found:
        assert [section.E_MPa for section in one.specimen.sections] in known
        assert one.specimen.side_mm in PAPER_SIDES_MM
        line = solve(one.specimen, FIELD).centreline
        assert line.tip_angle_deg == pytest.approx(20.0, rel=5e-3)


def test_a_tip_before_the_magnet():
    field = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=55.0)
    wanted = solve(gmc(2), field).centreline.tip_mm
    for one in find_designs(goals.tip_goal(*wanted), field, FREE, count=2):
        tip = solve(one.specimen, field).centreline.tip_mm
        assert np.hypot(*np.subtract(tip, wanted)) < goals.HIT_MM


def test_a_curve_drawn_in_another_frame():
    line = solve(gmc(4), FIELD).centreline
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    drawn = line.points_mm @ turn.T + [12.0, -5.0]
    goal = goals.curve_goal(drawn, align=True)
    assert goals.curve_length_mm(goal) == pytest.approx(30.0, rel=1e-3)
    found = find_designs(goal, FIELD, FREE, count=2)
    away = solve(found[0].specimen, FIELD).centreline.points_mm - line.points_mm
    assert np.hypot(*away.T).max() < 0.2
    with pytest.raises(InputError, match="begin at the clamp"):
        goals.curve_goal(drawn)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"total_length_mm": (100.0, 100.0)}, "do not add up"),
        ({"side_mm": (2.0, 1.0)}, "must be"),
        ({"recipe": [{"name": "r", "E_MPa": [1.0], "remanence_mT": 9.0}]}, "3 moduli"),
        ({"remanence_mT": 0.0}, "never bends"),
    ],
)
def test_impossible_limits(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        Makeable(**change)


@pytest.mark.parametrize(
    "make",
    [
        lambda: goals.radius_goal(0.0),
        lambda: goals.radius_goal(float("nan")),
        lambda: goals.angle_goal(0.0),
        lambda: goals.tip_goal(float("inf"), 1.0),
        lambda: goals.curve_goal(np.zeros((5, 2))),
        lambda: goals.curve_goal(np.zeros((2, 2))),
    ],
)
def test_impossible_goals(make):
    with pytest.raises(InputError):
        make()


def run(*arguments: str):
    return CliRunner().invoke(app, ["analysis", "design", *arguments])


def test_the_printed_specimen_is_a_specimen_file(tmp_path):
    figure, out = tmp_path / "band.svg", tmp_path / "files"
    result = run(
        "--radius-mm", "120", "--field-mT", "50", "--count", "3", "--json",
        "--figure", str(figure), "--out", str(out),
    )  # fmt: skip
    printed = json.loads(result.stdout)
    assert len(printed) == 3
    for number, one in enumerate(printed, start=1):
        path = tmp_path / "specimen.json"
        path.write_text(json.dumps(one["specimen"]))
        radius_mm = radius_of(read_specimen(path), FIELD)
        assert one["achieved_radius_mm"] == pytest.approx(radius_mm, rel=1e-9)
        assert radius_mm == pytest.approx(120.0, rel=5e-3)
        assert one["tolerance_mm"] > 0.0
        assert read_specimen(out / f"design_{number}.json") == read_specimen(path)
    assert figure.read_text().startswith("<?xml")


def test_wrong_usage_is_one_sentence(tmp_path):
    base = ["--radius-mm", "100", "--field-mT", "50"]
    curve = tmp_path / "c.csv"
    curve.write_text("x_mm,y_mm\n0,0\n10,a\n")
    for arguments, kind, sentence in (
        (["--field-mT", "50"], InputError, "exactly one"),
        ([*base, "--angle-deg", "20"], InputError, "exactly one"),
        (base[:2], InputError, "either --field-mT"),
        ([*base, "--length-mm", "100"], InputError, "do not add up"),
        ([*base, "--side-mm", "thick"], InputError, "number or LOW:HIGH"),
        ([*base, "--side-mm", "-1"], InputError, "instead received -1.0"),
        (["--radius-mm", "100", "--field-mT", "0"], InputError, "must not be zero"),
        ([*base, "--count", "0"], InputError, "count"),
        ([*base, "--figure", "a.gif"], InputError, "must end in"),
        (["--curve", str(curve), "--field-mT", "5"], ConfigError, "line 3"),
        (["--polyline", str(curve), "--field-mT", "5"], InputError, "--calibration"),
    ):
        error = run(*arguments).exception
        assert isinstance(error, kind), (arguments, error)
        assert sentence in str(error)


def test_the_first_of_several_is_not_flattered():
    """Its tolerance is that of 20 000 rods nobody has seen."""
    found = find_designs(goals.radius_goal(100.0), FIELD, FREE, count=5)
    many = scattered(
        found[0].specimen, FREE.scatter, 20_000, np.random.default_rng(987)
    )
    shapes = solve_shapes(designs_in(many, FIELD)).points
    made = goals.achieved(goals.radius_goal(1.0), shapes)
    low, high = np.quantile(made[np.isfinite(made)], [0.025, 0.975])
    assert found[0].tolerance == pytest.approx(0.5 * (high - low), rel=0.05)


def test_a_path_of_tips_is_met_in_all_its_fields():
    rod = gmc(2)
    fields = [UniformField(flux_mT=flux) for flux in (30.0, 60.0)]
    tips = [solve(rod, field).centreline.tip_mm for field in fields]
    tasks = [
        (goals.tip_goal(*tip), field) for tip, field in zip(tips, fields, strict=True)
    ]
    for one in design_all(tasks, FREE, count=2):
        for tip, field in zip(tips, fields, strict=True):
            reached = solve(one.specimen, field).centreline.tip_mm
            assert np.hypot(*np.subtract(reached, tip)) < goals.HIT_MM
        assert len(one.more) == 1
        assert one.more[0].specimen == one.specimen
    impossible = [tasks[0], (goals.tip_goal(29.0, -5.0), fields[1])]
    with pytest.raises(SolverError, match=r"a tip at \(29, -5\)"):
        design_all(impossible, FREE)


def test_the_command_takes_a_path_and_refuses_half_of_one(tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("flux_mT,x_mm,y_mm\n30,29.83,2.86\n60,29.35,5.55\n")
    command = ["analysis", "design", "--path", str(path), "--count", "1", "--json"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0
    (one,) = json.loads(done.stdout)
    assert one["error_mm"] < goals.HIT_MM
    assert one["more"][0]["error_mm"] < goals.HIT_MM
    for more, says in (
        (["--field-mT", "50"], "no other"),
        (["--radius-mm", "100"], "no other"),
    ):
        done = CliRunner().invoke(app, [*command, *more])
        assert done.exit_code != 0
        assert says in str(done.exception)
    two = ["--radius-mm", "100", "--field-mT", "50", "--field-mT", "80"]
    done = CliRunner().invoke(app, ["analysis", "design", *two])
    assert "received 2" in str(done.exception)
    path.write_text("flux_mT,x_mm,y_mm\n0,29.83,2.86\n")
    with pytest.raises(InputError, match="must not be zero"):
        read_path(path)
    path.write_text("gap_mm,x_mm,y_mm\n60,29.83,2.86\n")
    with pytest.raises(InputError, match="with --magnet"):
        read_path(path)
    assert len(read_path(path, magnet=Magnet.cube(55.0, 1.3))) == 1
