"""The house keeps its own rules."""

from __future__ import annotations

import ast
import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
from house import PACKAGES, circles, file_graph, room_graph

ROOT = Path(__file__).resolve().parent.parent


def tracked() -> list[Path]:
    done = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in done.stdout.splitlines()]


def test_every_package_folder_is_installed() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = set(settings["tool"]["setuptools"]["packages"])
    folders = settings["tool"]["setuptools"]["package-dir"]
    on_disk = {
        ".".join([name, *init.parent.relative_to(ROOT / folder).parts])
        for name, folder in folders.items()
        for init in (ROOT / folder).rglob("__init__.py")
    }
    assert listed == on_disk


def test_every_data_file_of_a_package_is_installed() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    tables = settings["tool"]["setuptools"]
    data = tables["package-data"]
    folders = {ROOT / path: name for name, path in tables["package-dir"].items()}
    for path in tracked():
        top = ROOT / path.relative_to(ROOT).parts[0]
        if top not in folders or path.suffix == ".py":
            continue
        packages = [
            folder for folder in path.parents if (folder / "__init__.py").is_file()
        ]
        inside = path.relative_to(packages[0]).as_posix()
        name = "magbend." + ".".join(packages[0].relative_to(ROOT).parts)
        patterns = [*data["*"], *data.get(name, ())]
        same_depth = [p for p in patterns if p.count("/") == inside.count("/")]
        assert any(fnmatch(inside, pattern) for pattern in same_depth), path


def test_no_file_names_a_package_index_or_a_path_of_a_machine() -> None:
    # Each pattern is written so that this file does not match itself.
    patterns = (
        r"pypi\.or[g]",
        r"files\.pythonhoste[d]",
        r"(?<![\w.])/(work|root|home)/\w",
    )
    for path in tracked():
        if path.suffix in {".png", ".jpg", ".pdf", ".npz", ".parquet"}:
            continue
        if not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        for pattern in patterns:
            assert not re.search(pattern, text), f"{path.relative_to(ROOT)}: {pattern}"


def test_the_tree_stays_small() -> None:
    sizes = {path: path.stat().st_size for path in tracked() if path.is_file()}
    fixtures = sum(size for path, size in sizes.items() if "fixtures" in path.parts)
    assert fixtures < 20e6
    large = [str(path) for path, size in sizes.items() if size > 3e6]
    assert not large


def test_the_constraints_pin_every_dependency() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = settings["project"]
    wanted = list(project["dependencies"])
    for extra in project["optional-dependencies"].values():
        wanted += [item for item in extra if not item.startswith("magbend")]
    names = {
        re.split(r"[<>=\[ ]", item)[0].lower().replace("_", "-") for item in wanted
    }
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {
        line.split("==")[0].lower().replace("_", "-") for line in lines if "==" in line
    }
    assert names <= pinned


@pytest.mark.parametrize("package", PACKAGES)
def test_no_rooms_import_each_other_in_a_circle(package: str) -> None:
    assert circles(room_graph(package)) == []
    assert circles(file_graph(package)) == []


@pytest.mark.parametrize("stub", sorted(ROOT.glob("[a-z]*/**/__init__.pyi")), ids=str)
def test_no_name_of_a_face_hides_a_room(stub: Path) -> None:
    # Importing the room would put the module in the name's place.
    if "build" in stub.parts or ".venv" in stub.parts:
        return
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    names = {
        name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    }
    rooms = {path.stem for path in stub.parent.glob("*.py")}
    rooms |= {path.parent.name for path in stub.parent.glob("*/__init__.py")}
    assert names & rooms == set()
