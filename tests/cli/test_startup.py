"""The command answers at once: help loads nothing heavy."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from magbend.cli.main import main

HEAVY = (
    "numpy",
    "scipy",
    "cv2",
    "pandas",
    "numba",
    "matplotlib",
    "serial",
    "rich",
    "pydantic",
    "jinja2",
    "pyarrow",
    "dask",
    "jax",
    "emcee",
)

PROBE = """
import json, sys
sys.argv = ["magbend", *{arguments!r}]
from magbend.cli.main import app
try:
    app()
except SystemExit as stop:
    code = stop.code
print("\\n" + json.dumps([code, [name for name in {heavy!r} if name in sys.modules]]))
"""


def probe(arguments: list[str]) -> tuple[int | None, list[str]]:
    """Run a command in a process of its own; return exit code and heavy imports."""
    code = PROBE.format(arguments=arguments, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    stop, loaded = json.loads(done.stdout.splitlines()[-1])
    return stop, loaded


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["sim", "--help"],
        ["vision", "--help"],
        ["rig", "--help"],
        ["analysis", "--help"],
        ["analysis", "library", "--help"],
        ["sim", "shape", "--help"],
        ["vision", "extract", "--help"],
        ["rig", "run", "--help"],
        ["analysis", "report", "--help"],
        ["demo", "--help"],
        ["--version"],
    ],
    ids=" ".join,
)
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    code, loaded = probe(arguments)
    assert code in (0, None)
    assert loaded == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["sim", "shape", "--gmc", "2", "--field-mT", "50"],
        ["sim", "shape", "--gmc", "2", "--field-mT", "50", "--model", "solid"],
        ["sim", "shape", "--specimen", "ROD", "--magnet", "MAGNET", "--gap-mm", "60"],
        ["sim", "equilibria", "--gmc", "2", "--fold"],
        ["sim", "magnet"],
    ],
    ids=" ".join,
)
def test_one_solve_imports_no_compiler(arguments: list[str], tmp_path: Path) -> None:
    magnet = tmp_path / "magnet.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    specimen = Path(__file__).parents[2] / "fixtures" / "specimens" / "gmc2.toml"
    files = {"ROD": str(specimen), "MAGNET": str(magnet)}
    typed = [files.get(word, word) for word in arguments]
    code, loaded = probe(typed)
    assert code in (0, None)
    assert set(loaded) <= {"numpy", "pydantic"}


def commands(app: object, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every command of the tree, as typed."""
    found = []
    for command in app.registered_commands:  # type: ignore[attr-defined]
        name = command.name or command.callback.__name__.replace("_", "-")
        found.append((*path, name))
    for group in app.registered_groups:  # type: ignore[attr-defined]
        name = group.name or group.typer_instance.info.name
        found += commands(group.typer_instance, (*path, name))
    return found


def test_every_command_has_help_with_an_example() -> None:
    from typer.testing import CliRunner

    from magbend.cli.main import app

    runner = CliRunner()
    tree = commands(app)
    assert len(tree) > 15
    for command in tree:
        shown = runner.invoke(app, [*command, "--help"])
        assert shown.exit_code == 0, command
        assert "Example" in shown.output, f"magbend {' '.join(command)}"


def test_wrong_usage_ends_with_2_and_no_traceback() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "magbend.cli.main", "sim", "shape", "--no-such-option"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "--no-such-option" in done.stderr


def test_a_file_in_the_place_of_a_folder_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def make_a_folder() -> None:
        raise FileExistsError(17, "File exists", "taken")

    monkeypatch.setattr("magbend.cli.main.app", make_a_folder)
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 1
    assert capsys.readouterr().err == (
        "magbend: taken: is a file, not a folder; give another name\n"
    )
