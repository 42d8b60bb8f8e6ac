"""The surrogate: its promises on designs it has not seen, its borders, its tables."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.analysis.surrogate import model as surrogate
from magbend.analysis.surrogate.compare import compare, linear_a_per_mm
from magbend.analysis.surrogate.fit import deviations, draw, fit
from magbend.analysis.surrogate.tables import (
    corrected,
    fit_correction,
    load_correction,
    read_tables,
    save_correction,
)
from magbend.cli.main import app
from magbend.core.errors import ConfigError, InputError, StoreError
from magbend.sim import UniformField, gmc, solve
from magbend.sim.batch.shapes import designs_of


@pytest.fixture(scope="module")
def unseen():
    model = surrogate.load()
    designs = draw(8192, 20261122)
    return designs, *deviations(model, designs)


def test_errors_over_the_whole_domain(unseen):
    _, away, predicted = unseen
    assert np.sqrt(np.mean(away**2)) < 0.0005
    assert away[:, -1].max() < 0.03
    assert predicted.inside.mean() > 0.999


def test_the_error_bar_is_honest_on_unseen_designs(unseen):
    _, away, predicted = unseen
    covered = away.max(axis=1) <= predicted.error_mm
    assert 0.93 <= covered[predicted.inside].mean() <= 0.97
    # And not only on average: in each third of the bend.
    bend = predicted.points[:, -1, 3]
    for low, high in ((0.0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1.0)):
        ends = np.quantile(bend, [low, high])
        third = (bend >= ends[0]) & (bend <= ends[1]) & predicted.inside
        assert covered[third].mean() > 0.90


def test_predicts_the_rods_of_the_paper():
    model = surrogate.load()
    for number in range(1, 8):
        rod = gmc(number)
        found = surrogate.predict(model, designs_of(rod, 66.0))
        tip = solve(rod, UniformField(flux_mT=66.0)).centreline.tip_mm
        away = np.hypot(*(found.points[0, -1, 1:3] - np.array(tip)))
        assert found.inside[0]
        assert away < min(3.0 * found.error_mm[0], 0.005)


def test_turning_the_field_mirrors_the_shape():
    model = surrogate.load()
    up, down = (
        surrogate.predict(model, designs_of(gmc(3), flux)).points[0]
        for flux in (80.0, -80.0)
    )
    np.testing.assert_allclose(up[:, 1], down[:, 1], atol=1e-12)
    np.testing.assert_allclose(up[:, 2:], -down[:, 2:], atol=1e-12)


def test_outside_the_trust_region_there_is_no_bar():
    designs = draw(64, 5)
    beyond = replace(
        designs,
        flux_mT=designs.flux_mT * 100.0,
        remanence_mT=designs.remanence_mT * 1e3,
    )
    rising = replace(designs, E_MPa=designs.E_MPa[:, ::-1])
    model = surrogate.load()
    assert not surrogate.predict(model, beyond).inside.any()
    found = surrogate.predict(model, rising)
    assert not found.inside.any()
    assert np.all(np.isnan(found.error_mm))


def test_other_rods_and_fields_are_refused():
    designs = draw(64, 5)
    with pytest.raises(InputError, match="angle_deg = 90"):
        surrogate.predict(surrogate.load(), replace(designs, angle_deg=designs.side_mm))
    two = replace(
        designs, length_mm=designs.length_mm[:, :2], E_MPa=designs.E_MPa[:, :2]
    )
    with pytest.raises(InputError, match="three sections"):
        surrogate.predict(surrogate.load(), two)


def test_a_small_fit_has_a_wide_but_honest_bar():
    model = fit(degree=3, modes=5, training=1024)
    away, predicted = deviations(model, draw(4096, 99))
    covered = away.max(axis=1) <= predicted.error_mm
    assert 0.92 <= covered[predicted.inside].mean() <= 0.98
    assert 0.0005 < np.sqrt(np.mean(away**2)) < 0.05


@pytest.mark.parametrize("damage", ["missing", "cut", "other"])
def test_damaged_files_are_one_sentence(tmp_path, damage):
    path = tmp_path / "s.npz"
    surrogate.save(surrogate.load(), path)
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:5000])
    else:
        np.savez(path, mean=np.zeros(60))
    with pytest.raises(StoreError, match=r"s\.npz: (is damaged|there is no such)"):
        surrogate.load(path)


def test_the_linear_formula_is_exact_for_weak_fields():
    rod = gmc(6)
    line = solve(rod, UniformField(flux_mT=0.05)).centreline
    x, y = line.x_mm, line.y_mm
    wanted = np.trapezoid(x**2 * y, x) / np.trapezoid(x**4, x)
    found = linear_a_per_mm(designs_of(rod, 0.05))[0]
    assert found == pytest.approx(wanted, rel=2e-3)


def test_the_table_is_honest():
    rows = {row.name: row for row in compare(surrogate.load(), designs=512)}
    order = ["direct solve (bound)", "surrogate", "best parabola", "paper's network"]
    errors = [rows[name].rms_mm for name in order]
    assert errors == sorted(errors)
    assert rows["linear formula"].time_us > 0.0


# imported tables


def export(folder: Path, number: int, flux_mT: float) -> Path:
    """Write a table as a 3D program would: the solid model stands for one."""
    rod = gmc(number)
    line = solve(rod, UniformField(flux_mT=flux_mT), model="solid").centreline
    lines = ["% Model: rod.mph"]
    for i, section in enumerate(rod.sections, start=1):
        lines += [
            f"% length{i}_mm = {section.length_mm}",
            f"% E{i}_MPa = {section.E_MPa}",
        ]
    lines += [f"% side_mm = {rod.side_mm}", f"% remanence_mT = {rod.remanence_mT}"]
    lines += ["% s (mm)   x (mm)   y (mm)   flux (mT)"]
    table = zip(line.s_mm[::3], line.x_mm[::3], line.y_mm[::3], strict=True)
    lines += [f"{s:.9g} {x:.9g} {y:.9g} {flux_mT:g}" for s, x, y in table]
    path = folder / f"gmc{number}_{flux_mT:g}.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_correction_learns_what_the_rod_misses(tmp_path):
    paths = [
        export(tmp_path, n, flux) for n in (1, 2, 3, 5, 7) for flux in (40.0, 90.0)
    ]
    cases = read_tables(paths)
    assert len(cases) == 10
    learnt = fit_correction(cases)
    assert learnt.error_mm < 0.5 * learnt.rod_error_mm
    # On a rod and field that were not among the tables.
    rod = gmc(4)
    truth = solve(rod, UniformField(flux_mT=60.0), model="solid").centreline
    points, inside = corrected(learnt, designs_of(rod, 60.0))
    assert inside[0]
    assert np.hypot(*(points[0, -1, 1:3] - truth.tip_mm)) <= learnt.error_mm
    _, beyond = corrected(learnt, designs_of(rod, 1000.0))
    assert not beyond[0]
    save_correction(learnt, tmp_path / "c.json")
    again = load_correction(tmp_path / "c.json")
    np.testing.assert_array_equal(again.coefficients, learnt.coefficients)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("% side_mm", "% sidemm"), "side_mm is missing"),
        (("x (mm)", "z (mm)"), "must have columns x and y"),
        ((" 50\n30 ", " 50\n30 30 "), "line 31: has more values"),
        ((" 50\n30 ", " nan\n30 "), "flux_mT is missing"),
        (
            ("% length3_mm = 10.0", "% length3_mm = 2.0"),
            "30 mm long, and the specimen 22 mm",
        ),
    ],
)
def test_broken_tables_are_one_sentence(tmp_path, change, sentence):
    path = export(tmp_path, 2, 50.0)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    with pytest.raises(InputError, match=sentence) as error:
        read_tables([path])
    assert path.name in str(error.value)


def test_a_native_sweep_needs_a_specimen_and_the_name_of_its_field(tmp_path):
    rod, factor = gmc(2), 1e-3
    heads, columns = ["X (m)"], []
    for flux_mT in (40.0, 60.0, 80.0):
        line = solve(rod, UniformField(flux_mT=flux_mT), model="solid").centreline
        columns = columns or [line.s_mm * factor]
        heads += [f"{axis} (m) @ B0={flux_mT * 1e-3:g}" for axis in "xy"]
        columns += [line.x_mm * factor, line.y_mm * factor]
    path = tmp_path / "sweep.txt"
    rows = np.column_stack(columns)[::3]
    np.savetxt(path, rows, "%.12g", "   ", header="   ".join(heads), comments="% ")
    cases = read_tables([path], specimen=rod, flux="B0=T")
    assert [float(case.design.flux_mT[0]) for case in cases] == [40.0, 60.0, 80.0]
    assert fit_correction(cases).error_mm < 0.01
    with pytest.raises(ConfigError, match=r"length1_mm is missing.*--specimen"):
        read_tables([path])
    with pytest.raises(ConfigError, match=r"--flux must be NAME=UNIT.*B0"):
        read_tables([path], specimen=rod, flux="B=T")
    with pytest.raises(InputError, match="add --flip"):
        read_tables([path], specimen=replace(rod, remanence_mT=-20.0), flux="B0=T")


def test_two_cases_are_too_few(tmp_path):
    cases = read_tables([export(tmp_path, 2, flux) for flux in (40.0, 80.0)])
    with pytest.raises(InputError, match="at least three cases"):
        fit_correction(cases)


def test_commands(tmp_path):
    runner = CliRunner()
    asked = ["analysis", "surrogate", "predict", "--gmc", "2", "--field-mT", "50"]
    shape = tmp_path / "shape.csv"
    answer = json.loads(
        runner.invoke(app, [*asked, "--json", "--out", str(shape)]).stdout
    )
    assert answer["tip_mm"] == pytest.approx([29.53532, 4.70952], abs=1e-3)
    assert len(shape.read_text().splitlines()) == 62
    far = runner.invoke(app, [*asked[:-1], "50000"])
    assert isinstance(far.exception, InputError)
    tables = [str(export(tmp_path, n, 50.0)) for n in (1, 2, 3, 4)]
    out = tmp_path / "c.json"
    asked_too = ["analysis", "surrogate", "correct", *tables, "--out", str(out)]
    assert runner.invoke(app, asked_too).exit_code == 0
    again = runner.invoke(app, [*asked, "--correction", str(out), "--json"])
    assert json.loads(again.stdout)["error_mm"] < 0.05
