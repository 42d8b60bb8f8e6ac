"""The commands: exit codes, fixed words, one sentence for a mistake."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pandas as pd
import pytest
from analysis_factory import write_run
from scipy.io import loadmat

from magbend.analysis import compare_run, fit_runs, load_run
from magbend.analysis.compare.export import export_runs
from magbend.analysis.fit.posterior import sample_posterior
from magbend.cli.main import main
from magbend.core.errors import InputError, MissingExtraError


def call(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: object
) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["magbend", "analysis", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        main()
    out = capsys.readouterr()
    return int(stop.value.code or 0), out.out, out.err


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "gmc2", sigma_mm=0.005, failed=[1])


def test_compare(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    code, out, _ = call(capsys, monkeypatch, "compare", run, "--json")
    rows = json.loads(out)
    assert code == 0
    assert len(rows) == 6
    header = (run / "comparison.csv").read_text().splitlines()[0]
    assert header.startswith(
        "run,step,gap_mm,flux_mT,model,rms_mm,max_mm,tip_mm,tip_percent,tip_angle_deg,"
        "radius_measured_mm,radius_simulated_mm,circularity_measured,"
        "circularity_simulated,status"
    )
    code, out, _ = call(capsys, monkeypatch, "compare", run)
    assert code == 0
    assert "failed frame" in out


def test_compare_stops_where_nothing_can_be_compared(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = write_run(tmp_path / "bad", failed=[0, 1, 2])
    code, _, err = call(capsys, monkeypatch, "compare", path)
    assert code == 1
    assert "no step could be compared" in err
    code, _, err = call(capsys, monkeypatch, "compare", tmp_path / "none")
    assert code == 1
    assert err.count("\n") == 1
    assert "Traceback" not in err


@pytest.mark.parametrize("command", ["compare", "report", "fit", "export"])
def test_a_bad_run_among_good_ones_is_named_and_left_out(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    command: str,
) -> None:
    folder = tmp_path / "runs"
    for name in ("a", "b", "c"):
        write_run(folder / name, sigma_mm=0.005)
    (folder / "b" / "frames.csv").unlink()
    out = tmp_path / "out.html" if command == "report" else tmp_path / "out.csv"
    more = ["--no-fit"] if command == "report" else []
    code, _, err = call(capsys, monkeypatch, command, folder, "--out", out, *more)
    assert code == 0
    assert f"left out: {folder / 'b'}: frames.csv is missing" in err
    assert "1 of 3 runs left out" in err
    if command == "compare":
        assert set(pd.read_csv(out)["run"]) == {"a", "c"}
    if command == "report":
        page = out.read_text()
        assert "1 of 3 runs could not be read or compared" in page
        assert "frames.csv is missing" in page
    for name in ("a", "c"):
        (folder / name / "frames.csv").unlink()
    code, _, err = call(capsys, monkeypatch, command, folder, "--out", out)
    assert code == 1


@pytest.mark.parametrize("command", ["compare", "fit", "report", "export"])
def test_out_is_refused_before_the_work_and_its_folders_are_made(
    run: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    command: str,
) -> None:
    (tmp_path / "file").write_text("")
    bad = tmp_path / "file" / "out.csv"
    with monkeypatch.context() as patch:
        for work in ("compare_run", "fit_runs"):
            patch.setattr(f"magbend.analysis.{work}", _must_not_be_called)
        code, _, err = call(capsys, patch, command, run, "--out", bad)
    assert code == 1
    assert "a file stands where a folder belongs" in err
    assert not (run / "comparison.csv").exists()
    good = tmp_path / "new" / "deep" / "out.csv"
    code, _, err = call(capsys, monkeypatch, command, run, "--out", good)
    assert code == 0, err
    assert any(good.parent.iterdir())


def _must_not_be_called(*_: object, **__: object) -> None:
    raise AssertionError("the work began before --out was checked")


def test_fit(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    code, out, _ = call(capsys, monkeypatch, "fit", run, "--json")
    data = json.loads(out)
    assert code == 0
    assert data == json.loads((run / "fit.json").read_text())
    assert data["not_identifiable"] == []
    code, out, _ = call(capsys, monkeypatch, "fit", run, "--free", "remanence_mT")
    assert code == 0
    assert "not identifiable" in out
    assert "E_MPa[0]/remanence_mT" in out


def test_fit_takes_priors_by_name(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    words = ("fit", run, "--hold", "all", "--prior", "magnet_percent=5", "--json")
    code, out, _ = call(capsys, monkeypatch, *words)
    assert code == 0
    names = {row["name"] for row in json.loads(out)["nuisance"]}
    assert names == {"magnet_percent"}
    for wrong in ("colour=1", "magnet_percent"):
        code, _, err = call(capsys, monkeypatch, "fit", run, "--prior", wrong)
        assert code == 2
        assert "--prior" in err
    code, _, err = call(capsys, monkeypatch, "fit", run, "--field", "dipole")
    assert code == 2


def test_report(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    code, out, err = call(capsys, monkeypatch, "report", run, "--no-fit")
    assert code == 0
    assert out.strip() == str(run / "report.html")
    assert "failed frame" in err
    assert (run / "report.html").is_file()
    assert (run / "comparison.csv").is_file()


def test_probe_and_audit(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    code, out, _ = call(capsys, monkeypatch, "probe", "--json")
    assert code == 0
    assert json.loads(out)["remanence_mT"] == pytest.approx(111, abs=1)
    words = ("probe", "--reading-mT", "20.07", "--side-mm", "1.0")
    code, out, _ = call(capsys, monkeypatch, *words)
    assert code == 0
    assert "remanence 109.9 mT at a stand-off of 0.459 mm" in out
    code, _, err = call(capsys, monkeypatch, "probe", "--reading-mT", "20.07")
    assert code == 1
    assert "--side-mm" in err
    code, out, _ = call(capsys, monkeypatch, "audit")
    assert code == 0
    assert "1.2186" in out


def test_export_round_trip(run: Path, tmp_path: Path) -> None:
    done = compare_run(load_run(run))
    written = export_runs([done], tmp_path / "out")
    assert {path.suffix for path in written} == {".csv", ".parquet", ".mat"}
    points = pd.read_csv(tmp_path / "out" / "runs_points.csv")
    same = pd.read_parquet(tmp_path / "out" / "runs_points.parquet")
    assert len(points) == len(same) == 122
    assert {"s_mm", "x_mm", "gap_mm", "flux_mT"} <= set(points)
    matlab = loadmat(tmp_path / "out" / "runs.mat", simplify_cells=True)
    assert matlab["points"]["x_mm"] == pytest.approx(points["x_mm"].to_numpy())
    assert matlab["comparison"]["status"][2].startswith("failed")
    [only] = export_runs([done], tmp_path / "one.mat")
    assert only.is_file()
    with pytest.raises(InputError, match="must end in"):
        export_runs([done], tmp_path / "runs.xlsx")


def test_posterior_agrees_with_the_fit(tmp_path: Path) -> None:
    pytest.importorskip("emcee")
    run = load_run(write_run(tmp_path / "a", sigma_mm=0.005))
    fit = fit_runs([run], judged=False)
    first = sample_posterior(fit, steps=100, walkers=8, seed=1)
    data = first.as_dict()
    for k in range(3):
        half = (data["q97_5"][k] - data["q2_5"][k]) / 2.0
        assert data["median"][k] == pytest.approx(
            fit.E_MPa[k], abs=2.0 * fit.E_sd_MPa[k]
        )
        assert 0.4 < half / (1.96 * fit.E_sd_MPa[k]) < 1.8
    again = sample_posterior(fit, steps=100, walkers=8, seed=1)
    assert (first.samples == again.samples).all()


def test_posterior_without_emcee_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = fit_runs([load_run(write_run(tmp_path / "a"))], judged=False)
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(MissingExtraError, match=r"pip install \"\.\[bayes\]\""):
        sample_posterior(fit)


@pytest.mark.parametrize("command", ["fit", "compare", "report"])
def test_an_impossible_clamp_angle_is_refused_before_the_work(
    command: str,
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("magbend.analysis.fit.runs.fit_runs", _must_not_be_called)
    code, _, err = call(capsys, monkeypatch, command, run, "--clamp-angle-deg", 179)
    assert code == 1
    assert "--clamp-angle-deg" in err
    assert "179" in err
