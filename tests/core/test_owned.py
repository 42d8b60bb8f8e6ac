"""A folder has one owner; nobody else's is taken; what was made is accounted for."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from magbend.core.derived import check_derived, note_derived, read_manifest
from magbend.core.errors import InputError, StoreError
from magbend.core.files import write_text
from magbend.core.owned import FOLDER_FILE, MARK, is_marked, owning_folder, root_of

HOLD = """
import sys, pathlib
from magbend.core.owned import owning_folder
with owning_folder(pathlib.Path(sys.argv[1]), "run", "rig run"):
    print("held", flush=True)
    sys.stdin.read()
"""


def hold(folder: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_process_is_told_who_writes_and_death_frees_the_folder(tmp_path):
    folder = tmp_path / "run"
    with hold(folder) as process:
        with (
            pytest.raises(
                StoreError, match=rf"magbend rig run, process {process.pid} on"
            ),
            owning_folder(folder, "run", "vision extract"),
        ):
            pass
        process.kill()
        process.wait()
        with owning_folder(folder, "run", "vision extract"):
            mark = json.loads((folder / MARK / FOLDER_FILE).read_bytes())
            assert mark["kind"] == "run"


def test_a_folder_that_was_made_and_stayed_empty_is_removed(tmp_path):
    folder = tmp_path / "a" / "run"
    with owning_folder(folder, "run", "rig run"):
        assert is_marked(folder)
    assert not folder.exists()
    with owning_folder(folder, "run", "rig run"), owning_folder(folder, "x", "inner"):
        write_text(folder / "a.txt", "kept")
        assert root_of(folder / "a.txt") == folder.resolve()
    assert is_marked(folder)
    with owning_folder(folder, "run", "rig run"):
        pass
    assert (folder / "a.txt").read_text() == "kept"


@pytest.mark.parametrize("names", [["plan.toml", "images/", "wire.log"], ["notes.txt"]])
def test_a_folder_of_somebody_else_is_left_as_it_is(names, tmp_path):
    for name in names:
        path = tmp_path / name
        path.mkdir() if name.endswith("/") else path.write_text("mine")
    with (
        pytest.raises(StoreError, match="was not made by magbend"),
        owning_folder(tmp_path, "run", "rig run"),
    ):
        pass
    assert sorted(f"{p.name}/" if p.is_dir() else p.name for p in tmp_path.iterdir()) \
        == sorted(names)  # fmt: skip


def test_a_link_out_of_an_owned_folder_stops_the_writing(tmp_path):
    folder = tmp_path / "run"
    with owning_folder(folder, "run", "rig run"):
        write_text(folder / "a.txt", "kept")
    (tmp_path / "precious").write_text("mine")
    (folder / "report.html").symlink_to(tmp_path / "precious")
    with (
        pytest.raises(StoreError, match=r"report\.html: is a link that leaves"),
        owning_folder(folder, "run", "analysis report"),
    ):
        pass


def test_a_file_in_the_way_and_a_folder_without_rights_are_sentences(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(InputError), owning_folder(path, "run", "rig run"):
            pass


@pytest.mark.skipif(os.name != "posix", reason="modes and links are POSIX")
def test_a_private_file_stays_private_and_a_link_is_written_through(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    real.chmod(0o600)
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o600
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises((InputError, OSError)):
        write_text(tmp_path / "loop", "x")


def made_run(folder: Path) -> Path:
    with owning_folder(folder, "run", "rig run"):
        write_text(folder / "photo.png", "pixels")
        write_text(folder / "centrelines.csv", "points")
        note_derived(
            [folder / "centrelines.csv"],
            sources=[folder / "photo.png", folder.parent / "calibration.json"],
            command="vision extract",
        )
        write_text(folder / "fit.json", "moduli")
        note_derived(
            [folder / "fit.json"], sources=[folder / "centrelines.csv"],
            command="analysis fit",
        )  # fmt: skip
    return folder


def statuses(folder: Path) -> dict[str, str]:
    return {found.name: found.status for found in check_derived(folder)}


def test_the_manifest_tells_altered_missing_and_older_inputs_apart(tmp_path):
    (tmp_path / "calibration.json").write_text("camera")
    folder = made_run(tmp_path / "run")
    assert set(statuses(folder).values()) == {"good"}
    entry = read_manifest(folder)["centrelines.csv"]
    assert set(entry["from"]) == {"photo.png"}
    assert set(entry["from_elsewhere"]) == {"calibration.json"}
    (folder / "photo.png").write_text("other pixels")
    assert statuses(folder) == {"centrelines.csv": "older input", "fit.json": "good"}
    (folder / "centrelines.csv").write_text("points, edited")
    assert statuses(folder) == {"centrelines.csv": "altered", "fit.json": "older input"}
    (folder / "fit.json").unlink()
    assert statuses(folder)["fit.json"] == "missing"


def test_a_damaged_manifest_is_not_believed(tmp_path):
    (tmp_path / "calibration.json").write_text("camera")
    folder = made_run(tmp_path / "run")
    path = folder / "manifest.json"
    path.write_text(path.read_text().replace("analysis fit", "analysis fix"))
    with pytest.raises(StoreError, match="altered or damaged"):
        statuses(folder)
    assert (folder / MARK / "folder.json").is_file()


def test_a_folder_whose_maker_died_while_marking_it_is_taken(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    (folder / MARK).mkdir(parents=True)
    (folder / MARK / ".folder.json.1d86e901.tmp").write_text("{")
    with owning_folder(folder, "run", "rig run"):
        assert is_marked(folder)
        (folder / "kept").write_text("")
    assert not list((folder / MARK).glob(".*.tmp"))
