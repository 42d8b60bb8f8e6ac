"""Somebody's table becomes a run that is compared, fitted and reported as our own."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from analysis_factory import MAGNET, write_run
from scipy.io import savemat
from typer.testing import CliRunner

from magbend.analysis import compare_run, load_run
from magbend.analysis.compare.compare import comparison_table
from magbend.analysis.compare.export import export_runs
from magbend.analysis.imports.judge import Reading
from magbend.analysis.imports.run import import_table
from magbend.analysis.imports.steps import read_steps, write_template
from magbend.analysis.runs.data import RunData
from magbend.cli.main import app
from magbend.core.centreline import Centreline
from magbend.core.errors import InputError
from magbend.core.specimen_file import specimen_dict
from magbend.rig import verify_run
from magbend.sim import UniformField, gmc, solve

GAPS_MM, FLUX_MT = (70.0, 60.0, 50.0), (38.0, 50.0, 66.0)
SHAPE = ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm")


def toml(data: dict[str, object]) -> str:
    lines = [f"{k} = {json.dumps(v)}" for k, v in data.items() if k != "section"]
    for section in data.get("section", ()):  # type: ignore[attr-defined]
        lines += ["[[section]]", *(f"{k} = {v}" for k, v in section.items())]
    return "\n".join(lines) + "\n"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder with a specimen, a magnet and shapes measured at three gaps."""
    (tmp_path / "rod.toml").write_text(toml(specimen_dict(gmc(2))))
    (tmp_path / "cube.toml").write_text("side_mm = 55.0\nremanence_T = 1.3\n")
    rows = ["centreline,gap_mm,flux_mT,simulated,lamp"]
    for i, (gap_mm, flux_mT) in enumerate(zip(GAPS_MM, FLUX_MT, strict=True)):
        line(flux_mT).to_csv(tmp_path / f"m{i}.csv")
        line(1.01 * flux_mT).to_csv(tmp_path / f"c{i}.csv")
        rows.append(f"m{i}.csv,{gap_mm},{flux_mT},c{i}.csv,warm")
    (tmp_path / "steps.csv").write_text("\n".join(rows) + "\n")
    return tmp_path


def line(flux_mT: float) -> Centreline:
    found = solve(gmc(2), UniformField(flux_mT=flux_mT)).centreline
    assert found is not None
    return found


def imported(folder: Path, **options: object) -> Path:
    options = {"specimen_file": folder / "rod.toml"} | options
    (done,) = import_table(folder / "steps.csv", folder / "run", **options)  # type: ignore[arg-type]
    return done.path


def test_a_table_of_shapes_becomes_a_run(bench: Path) -> None:
    run = load_run(imported(bench, magnet_file=bench / "cube.toml"))
    assert run.warnings == ()  # there is no photograph that a calibration would be for
    assert "array(" not in repr(run)
    assert [step.gap_mm for step in run.steps] == list(GAPS_MM)
    assert [step.flux_mT for step in run.steps] == list(FLUX_MT)
    assert run.record["imported"]["table"] == "sources/steps.csv"
    assert run.record["twin"] is False
    done = compare_run(run)
    assert done.models == ("uniform", "magnet", "imported")
    # The shapes are those of the uniform field, so that model leaves nothing.
    assert all(c.errors and c.errors.rms_mm < 1e-4 for c in done.of("uniform"))
    for comparison, flux_mT in zip(done.of("imported"), FLUX_MT, strict=True):
        tip = np.subtract(line(flux_mT).tip_mm, line(1.01 * flux_mT).tip_mm)
        assert comparison.errors is not None
        assert comparison.errors.tip_mm == pytest.approx(np.hypot(*tip), abs=1e-6)
    table = comparison_table([done])
    assert set(table["model"]) == {"uniform", "magnet", "imported"}


def test_sources_are_copied_and_hashed(bench: Path) -> None:
    path = imported(bench)
    assert verify_run(path) == []
    steps = [json.loads(row) for row in (path / "steps.jsonl").read_text().splitlines()]
    assert steps[1]["columns"] == {"lamp": "warm"}
    for file in steps[1]["files"]:
        data = (path / file["path"]).read_bytes()
        assert hashlib.sha256(data).hexdigest() == file["sha256"]
    (path / "sources" / "m1.csv").write_text("changed")
    assert any("m1.csv" in problem for problem in verify_run(path))


def test_flux_alone_and_gap_alone_are_enough(bench: Path) -> None:
    table = (bench / "steps.csv").read_text()
    (bench / "steps.csv").write_text(table.replace("70.0,38.0", ",38.0"))
    done = compare_run(load_run(imported(bench, magnet_file=bench / "cube.toml")))
    first = [c for c in done.comparisons if c.step.index == 0]
    assert [c.status for c in first if c.model != "magnet"] == ["ok", "ok"]
    assert "no gap" in next(c.status for c in first if c.model == "magnet")
    (bench / "steps.csv").write_text(table.replace("70.0,38.0", "70.0,"))
    import_table(
        bench / "steps.csv", bench / "b", specimen_file=bench / "rod.toml",
        magnet_file=bench / "cube.toml",
    )  # fmt: skip
    other = compare_run(load_run(bench / "b"))
    assert "no field reading" in other.of("uniform")[0].status
    assert other.of("magnet")[0].ok


@pytest.mark.parametrize("head", ["B (T)", "field [T]", "Magnetic field (T)"])
def test_a_reading_of_another_name_is_a_reading(bench: Path, head: str) -> None:
    """It was kept in the records, and the run had no reading."""
    text = (bench / "steps.csv").read_text()
    text = text.replace("flux_mT", head).replace(",38.0", ",.038")
    (bench / "steps.csv").write_text(
        text.replace(",50.0,c", ",.05,c").replace(",66.0", ",.066")
    )
    run = load_run(imported(bench, magnet_file=bench / "cube.toml"))
    assert [step.flux_mT for step in run.steps] == pytest.approx([38.0, 50.0, 66.0])


def test_rods_of_one_table_become_runs_of_their_own(bench: Path) -> None:
    (bench / "other.toml").write_text(toml(specimen_dict(gmc(2)) | {"name": "other"}))
    rows = (bench / "steps.csv").read_text().splitlines()
    kinds = ["specimen", "rod.toml", "other.toml", "other.toml"]
    text = "\n".join(f"{row},{kind}" for row, kind in zip(rows, kinds, strict=True))
    (bench / "steps.csv").write_text(text)
    done = import_table(bench / "steps.csv", bench / "runs")
    assert [(run.path.name, run.steps) for run in done] == [("rod", 1), ("other", 2)]
    assert load_run(bench / "runs" / "other").specimen.name == "other"


REFUSED: dict[str, tuple[Callable[[str], str], str]] = {
    "gauss typed as mT": (
        lambda t: t.replace(",38.0", ",380").replace(",50.0,c", ",500,c")
        .replace(",66.0", ",660"), r"fit as flux \(G\)"),
    "tesla typed as mT": (
        lambda t: t.replace(",38.0", ",.038").replace(",50.0,c", ",.05,c")
        .replace(",66.0", ",.066"), r"fit as flux \(T\)"),
    "centimetres typed as mm": (
        lambda t: t.replace("70.0,", "7.0,").replace("60.0,", "6.0,")
        .replace("50.0,6", "5.0,6"), r"fit as gap \(cm\)"),
    "readings of another magnet": (
        lambda t: t.replace(",38.0", ",205").replace(",50.0,c", ",270,c")
        .replace(",66.0", ",350"), "look at the magnet"),
    "readings swapped": (
        lambda t: t.replace("70.0,38.0", "70.0,66.0").replace("50.0,66.0", "50.0,38"),
        "lines 4 and 3.*swapped"),
    "no files": (lambda t: t.replace("centreline", "shapes"), "names a file"),
    "a missing file": (lambda t: t.replace("m1.csv", "m9.csv"), "line 3: .* m9.csv"),
    "a file elsewhere": (
        lambda t: t.replace("m1.csv", "../m1.csv"), "must lie in the folder"),
    "an absolute file": (
        lambda t: t.replace("m1.csv", "/etc/passwd"), "must lie in the folder"),
    "an empty row": (lambda t: t.replace("m1.csv,", ","), "line 3: must name"),
    "neither gap nor flux": (
        lambda t: t.replace("60.0,50.0", ","), "line 3: must have a gap_mm"),
    "a negative gap": (lambda t: t.replace("60.0,", "-60.0,"), "gap_mm must be"),
    "gap without unit": (lambda t: t.replace("gap_mm", "gap"), "head it gap_mm"),
    "a word": (lambda t: t.replace("60.0,", "sixty,"), "line 3: gap_mm must be"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_a_table_that_does_not_fit_is_refused_and_nothing_is_written(
    kind: str, bench: Path
) -> None:
    change, words = REFUSED[kind]
    table = bench / "steps.csv"
    table.write_text(change(table.read_text()))
    with pytest.raises(InputError, match=words):
        imported(bench, magnet_file=bench / "cube.toml")
    assert not (bench / "run").exists()


def test_another_rod_or_side_is_refused(bench: Path) -> None:
    data = specimen_dict(gmc(2))
    (bench / "rod.toml").write_text(toml(data | {"remanence_mT": -20.07}))
    with pytest.raises(InputError, match=r"m0.csv: bends to \+y.*--flip"):
        imported(bench)
    (bench / "rod.toml").write_text(toml(specimen_dict(gmc(2))))
    path = imported(bench)
    with pytest.raises(InputError, match="is there already"):
        imported(bench)
    assert len(load_run(path).steps) == 3


# Round trips: our run, out through another program's format, and in again.


def _columns(line_: Centreline) -> np.ndarray:
    return np.column_stack([getattr(line_, name) for name in SHAPE])


def write_csv(path: Path, line_: Centreline) -> None:
    np.savetxt(path, _columns(line_), "%.17g", ",", header=",".join(SHAPE), comments="")


def write_comsol(path: Path, line_: Centreline) -> None:
    head = "X (m)   s (m)   x (m)   y (m)   theta (rad)   kappa (1/m)"
    values = _columns(line_) * np.array([1e-3, 1e-3, 1e-3, 1.0, 1e3])
    values = np.column_stack([values[:, 0], values])
    np.savetxt(path, values, "%.17g", "   ", header=head, comments="% ")


def write_mathematica(path: Path, line_: Centreline) -> None:
    rows = ["{" + ", ".join(f"{v:.17g}" for v in r) + "}" for r in _columns(line_)]
    path.write_text(("{" + ",\n".join(rows) + "}").replace("e", "*^"))


def write_mat(path: Path, line_: Centreline) -> None:
    savemat(path, {name: getattr(line_, name) for name in SHAPE})


FORMATS = {
    "csv": write_csv, "txt": write_comsol, "wl": write_mathematica, "mat": write_mat
}  # fmt: skip


def sent(run: RunData, folder: Path, ending: str) -> Path:
    """Write a run through another program's format, and import that."""
    folder.mkdir()
    rows = ["centreline,gap_mm,flux_mT,flux_sd_mT,simulated"]
    for comparison in compare_run(run).of("magnet"):
        step, frame, found = comparison.step, comparison.frame, comparison.solution
        assert frame is not None
        assert frame.centreline is not None
        assert found is not None
        assert found.centreline is not None
        names = [f"{kind}{step.index}.{ending}" for kind in ("measured", "simulated")]
        FORMATS[ending](folder / names[0], frame.centreline)
        FORMATS[ending](folder / names[1], found.centreline)
        rows.append(
            f"{names[0]},{step.gap_mm!r},{step.flux_mT!r},{step.flux_sd_mT!r},{names[1]}"
        )
    (folder / "steps.csv").write_text("\n".join(rows))
    (folder / "rod.toml").write_text(toml(specimen_dict(gmc(2))))
    magnet = {"side_mm": MAGNET.sides_mm[0], "remanence_T": MAGNET.remanence_T}
    (folder / "cube.toml").write_text(toml(magnet))
    return imported(folder, magnet_file=folder / "cube.toml")


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    """A noisy run whose centrelines.csv has the ten digits of `vision extract`."""
    folder = tmp_path_factory.mktemp("ours")
    made = load_run(write_run(folder / "made", sigma_mm=0.005))
    return load_run(sent(made, folder / "tens", "csv"))


@pytest.mark.parametrize("ending", FORMATS)
def test_out_and_in_again_gives_the_same_comparison(
    ending: str, ours: RunData, tmp_path: Path
) -> None:
    before = compare_run(ours)
    again = compare_run(load_run(sent(ours, tmp_path / ending, ending)))
    for model, other in (("uniform",) * 2, ("magnet",) * 2, ("imported", "magnet")):
        for mine, theirs in zip(again.of(model), before.of(other), strict=True):
            for name in ("rms_mm", "max_mm", "tip_mm", "tip_angle_deg", "frechet_mm"):
                value, truth = mine.row()[name], theirs.row()[name]
                assert value == pytest.approx(truth, abs=1e-9), (model, name)


def test_our_own_export_comes_in_again(tmp_path: Path) -> None:
    ours = compare_run(load_run(write_run(tmp_path / "ours", sigma_mm=0.005)))
    export_runs([ours], tmp_path / "out.csv")
    rows = ["centreline,gap_mm,flux_mT"]
    rows += [
        f"out_points.csv @ step={step.index},{step.gap_mm!r},{step.flux_mT!r}"
        for step in ours.run.steps
    ]
    (tmp_path / "steps.csv").write_text("\n".join(rows))
    (tmp_path / "rod.toml").write_text(toml(specimen_dict(gmc(2))))
    run = load_run(imported(tmp_path))
    for step, mine in zip(ours.run.steps, run.steps, strict=True):
        old, new = ours.run.frame(step), run.frame(mine)
        assert old is not None
        assert new is not None
        assert old.centreline is not None
        assert new.centreline is not None
        np.testing.assert_allclose(
            new.centreline.points_mm, old.centreline.points_mm, atol=1e-9
        )
        np.testing.assert_allclose(new.sigma_mm, old.sigma_mm, atol=1e-9)


def test_a_folder_of_photographs_gets_a_table_to_fill(tmp_path: Path) -> None:
    for name in ("b.jpg", "a, first.png", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    table = write_template(tmp_path)
    text = table.read_text()
    assert "notes.txt" not in text
    table.write_text(text.replace("b.jpg,,,", "b.jpg,60,50,"))
    with pytest.raises(InputError, match="line 8: must have a gap_mm"):
        read_steps(table)
    table.write_text(table.read_text().replace('png",,,', 'png",70,38,'))
    rows = read_steps(table)
    assert [(row.photograph.name, row.gap_mm) for row in rows if row.photograph] == [
        ("a, first.png", 70.0), ("b.jpg", 60.0)
    ]  # fmt: skip
    assert all(math.isnan(row.flux_sd_mT) for row in rows)
    with pytest.raises(InputError, match="is there already"):
        write_template(tmp_path)


def test_the_command_says_what_it_did_and_what_comes_next(bench: Path) -> None:
    runner = CliRunner()
    asked = ["analysis", "import", str(bench / "steps.csv")]
    out = ["--specimen", str(bench / "rod.toml"), "--out", str(bench / "run")]
    answer = runner.invoke(app, [*asked, *out, "--magnet", str(bench / "cube.toml")])
    assert answer.exit_code == 0, answer.output
    assert "3 steps, 3 centrelines, 3 simulated shapes" in answer.stdout
    assert f"next: magbend analysis report {bench / 'run'}" in answer.stdout
    for command in ("compare", "fit", "report", "export"):
        more = ["--out", str(bench / "e.csv")] if command == "export" else []
        answer = runner.invoke(app, ["analysis", command, str(bench / "run"), *more])
        assert answer.exit_code == 0, (command, answer.output)
    page = (bench / "run" / "report.html").read_text()
    assert "imported from sources/steps.csv" in page
    assert "simulated elsewhere" in page


def test_flipped_shapes_are_the_mirror_image(bench: Path) -> None:
    for path in bench.glob("[mc]?.csv"):
        shape = Centreline.from_csv(path)
        Centreline(
            s_mm=shape.s_mm, x_mm=shape.x_mm, y_mm=-shape.y_mm,
            theta_rad=-shape.theta_rad, kappa_per_mm=-shape.kappa_per_mm,
        ).to_csv(path)  # fmt: skip
    with pytest.raises(InputError, match="add --flip"):
        imported(bench)
    done = compare_run(load_run(imported(bench, how=Reading(flip=True))))
    assert all(c.errors and c.errors.rms_mm < 1e-4 for c in done.of("uniform"))
