from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import MagbendError
from magbend.rig import write_templates

# A plan of one gap, quickly settled: the twin's photographs take their time.
QUICK = "gaps_mm = [70.0]"


@pytest.fixture(scope="module")
def bench_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of `rig init --twin` with one finished run of one step in it."""
    folder = tmp_path_factory.mktemp("bench")
    write_templates(folder, twin=True)
    plan = folder / "plan.toml"
    plan.write_text(plan.read_text().replace("gaps_mm = [70.0, 60.0, 50.0]", QUICK))
    words = ["rig", "run", str(plan), "--out", str(folder / "run"), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["status"], summary["steps_done"]) == ("success", 1)
    return folder


def test_run_and_verify(magbend, bench_folder: Path) -> None:
    done = magbend("rig", "verify", "run", cwd=bench_folder)
    assert done.returncode == 0
    assert "good, 1 steps, success" in done.stdout
    wire = (bench_folder / "run" / "wire.log").read_text()
    assert "$H" in wire
    manifest = json.loads((bench_folder / "run" / "run.json").read_text())
    assert manifest["twin"] is True


def test_resuming_what_is_not_there_begins_nothing(magbend, bench_folder: Path) -> None:
    done = magbend(
        "rig", "run", "plan.toml", "--out", "rnu", "--resume", cwd=bench_folder
    )
    assert done.returncode == 1
    assert "rnu: holds no run that could go on" in done.stderr
    assert not (bench_folder / "rnu").exists()


def test_the_stage_of_the_first_files_answers(magbend, bench_folder: Path) -> None:
    done = magbend("rig", "status", cwd=bench_folder)
    assert done.returncode == 0, done.stderr
    assert "home it" in done.stdout


def test_verify_fails_on_an_altered_picture(bench_folder: Path, tmp_path: Path) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(bench_folder / "run", copy)
    (copy / "images" / "step_000.png").write_bytes(b"x")
    result = CliRunner().invoke(app, ["rig", "verify", str(copy), "--json"])
    assert result.exit_code == 1
    assert "step_000.png: altered" in json.loads(result.stdout)["problems"][0]


def test_verify_tells_once_that_a_run_was_cut_off(
    magbend, bench_folder: Path, tmp_path: Path
) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(bench_folder / "run", copy)
    (copy / "end.json").unlink()
    done = magbend("rig", "verify", str(copy), cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr.count("was cut off and can be resumed") == 1


def test_a_run_is_not_overwritten(magbend, bench_folder: Path) -> None:
    done = magbend("rig", "run", "plan.toml", "--out", "run", cwd=bench_folder)
    assert done.returncode == 1
    assert "holds a run already" in done.stderr


def test_the_dry_run_moves_nothing_and_predicts(bench_folder: Path) -> None:
    plan = str(bench_folder / "plan.toml")
    result = CliRunner().invoke(app, ["rig", "run", plan, "--dry-run", "--json"])
    assert result.exit_code == 0
    (step,) = json.loads(result.stdout)["steps"]
    assert step["stage_mm"] == -80.0
    # The paper's Eq. 1-4 for 1.305 T at 70 mm.
    assert step["predicted_flux_mT"] == pytest.approx(36.52, abs=0.01)
    text = CliRunner().invoke(app, ["rig", "run", plan, "--dry-run"]).stdout
    assert "nothing was moved" in text
    assert not (bench_folder / "runs").exists()


def test_scan_field_fits_the_magnet(magbend, bench_folder: Path) -> None:
    done = magbend(
        "rig", "scan-field", "plan.toml", "--out", "scan", "--gaps-mm", "90,70,50",
        "--json", cwd=bench_folder,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert data["readings"] == 3
    assert data["magnet"]["remanence_T"] == pytest.approx(1.305, rel=0.06)
    assert (bench_folder / "scan" / "field.svg").exists()


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["rig", "run", "no.toml"], 1, "no.toml: there is no such file"),
        (["rig", "run", "plan.toml", "--resume"], 1, "--resume needs --out"),
        (["rig", "run", "plan.toml", "--out", "x", "--flux-mT", "1,2"], 1, "one read"),
        (["rig", "run", "plan.toml", "--out", "x", "--flux-mT", "a"], 1, "numbers"),
        (["rig", "verify", "nowhere"], 1, "no such run folder"),
        (["rig", "verify"], 2, "Missing argument"),
        (["rig", "run", "plan.toml", "--hurry"], 2, "No such option"),
        (["rig", "init", "."], 1, "is not overwritten"),
        (["rig", "run", "plan.toml", "--out", "plan.toml/x"], 1, "plan.toml"),
    ],
)
def test_mistakes_end_in_one_sentence(
    magbend, bench_folder, words, code, sentence
) -> None:
    done = magbend(*words, cwd=bench_folder)
    assert done.returncode == code
    assert sentence in done.stderr + done.stdout


def test_ctrl_c_at_the_prompt_for_a_reading_stops_the_run(monkeypatch) -> None:
    import typer

    from magbend.cli.rig_flux import ask_flux
    from magbend.rig.errors import StoppedError

    def press(*_arguments, **_options) -> None:
        raise typer.Abort

    monkeypatch.setattr(typer, "prompt", press)
    with pytest.raises(StoppedError):
        ask_flux(70.0)


@pytest.mark.parametrize(
    "words",
    [
        ["demo"],
        ["panel"],
        ["rig", "run", "p.toml"],
        ["analysis", "paper"],
        ["analysis", "fit", "run"],
    ],
)
def test_a_seed_below_zero_is_refused_before_anything_is_done(words):
    result = CliRunner().invoke(app, [*words, "--seed", "-1"])
    assert result.exit_code == 2
    assert "--seed" in result.output


@pytest.mark.parametrize("readings", ["380,500,660", "66,50,38", "38,50", "nan,50,66"])
def test_the_dry_run_refuses_the_readings_that_the_run_would(bench_folder, readings):
    words = ["rig", "run", str(bench_folder / "plan.toml"), "--dry-run"]
    result = CliRunner().invoke(app, [*words, "--flux-mT", readings])
    assert result.exit_code != 0
    assert "step " not in result.stdout


@pytest.mark.parametrize(
    ("row", "instead", "words", "sentence"),
    [
        ('port = "twin://board.json"', 'port = "/dev/ttyS9"', [], "names a real one"),
        ("direction = 1 ", "direction = -1 ", [], "no gap lies within the travel"),
        ("zero_mm = 150.0", "zero_mm = -150.0", [], "no gap lies within the travel"),
        ("min = 300.0", "min = 1e-9", [], "feed_mm_min.* from 1 to 100000 mm/min"),
        ("min = 300.0", "min = 1e9", [], "feed_mm_min.* from 1 to 100000 mm/min"),
        ("", "", ["--assume-gap-mm", "nan"], "--assume-gap-mm must be a finite number"),
        ("", "", ["--speed", "nan"], "--speed must be a finite number"),
    ],
)
def test_the_dry_run_refuses_the_bench_that_the_run_would(
    tmp_path: Path, row: str, instead: str, words: list[str], sentence: str
) -> None:
    write_templates(tmp_path, twin=True)
    rig = tmp_path / "rig.toml"
    text = rig.read_text()
    assert row in text
    rig.write_text(text.replace(row, instead) if row else text)
    plan = str(tmp_path / "plan.toml")
    result = CliRunner().invoke(app, ["rig", "run", plan, "--dry-run", *words])
    assert isinstance(result.exception, MagbendError)
    assert re.search(sentence, str(result.exception))
    assert {path.name for path in tmp_path.iterdir()} == {
        "rig.toml", "plan.toml", "specimen.toml",
    }  # fmt: skip
