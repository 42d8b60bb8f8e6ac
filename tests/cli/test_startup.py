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
import contextlib, io, json, sys
from magbend.cli.main import app
for arguments in {typed!r}:
    sys.argv = ["magbend", *arguments]
    code = 0
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            app()
    except SystemExit as stop:
        code = stop.code or 0
    loaded = [name for name in {heavy!r} if name in sys.modules]
    print(json.dumps([" ".join(arguments), code, loaded]))
"""


def probe(*typed: list[str]) -> dict[str, tuple[int, list[str]]]:
    """Run commands, one after another, in one fresh process.

    Returns the exit code of each and the heavy modules that are loaded after it: if
    none is, none of the commands so far has loaded any.
    """
    code = PROBE.format(typed=typed, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    rows = map(json.loads, done.stdout.splitlines())
    return {words: (code, loaded) for words, code, loaded in rows}


def test_help_imports_nothing_heavy() -> None:
    asked = [
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
    ]
    assert probe(*asked) == {" ".join(words): (0, []) for words in asked}


def test_one_solve_imports_no_compiler(tmp_path: Path) -> None:
    magnet = tmp_path / "magnet.toml"
    magnet.write_text("side_mm = 55.0\nremanence_T = 1.305\n")
    rod = Path(__file__).parents[2] / "fixtures" / "specimens" / "gmc2.toml"
    files = ["--specimen", str(rod), "--magnet", str(magnet)]
    found = probe(
        ["sim", "shape", "--gmc", "2", "--field-mT", "50"],
        ["sim", "shape", "--gmc", "2", "--field-mT", "50", "--model", "solid"],
        ["sim", "equilibria", "--gmc", "2", "--fold"],
        ["sim", "magnet"],
        ["sim", "shape", *files, "--gap-mm", "60"],
    )
    assert len(found) == 5
    for words, (code, loaded) in found.items():
        assert code == 0, words
        reads_files = "--specimen" in words
        assert loaded == (["numpy", "pydantic"] if reads_files else ["numpy"]), words


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
    from click.testing import CliRunner
    from typer.main import get_command

    from magbend.cli.main import app

    runner, built = CliRunner(), get_command(app)
    tree = commands(app)
    assert len(tree) > 15
    for command in tree:
        shown = runner.invoke(built, [*command, "--help"])
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
