from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.errors import StoreError
from magbend.rig.runs import folder as run_folder
from magbend.rig.runs.folder import RunFolder
from magbend.rig.runs.read import read_run, read_steps
from magbend.rig.runs.verify import verify_run

MANIFEST = {"name": "t", "plan": {"gaps_mm": [70.0, 60.0]}}


def commit(folder: RunFolder, index: int, data: bytes = b"picture") -> None:
    name = folder.image_name(index)
    gap_mm = MANIFEST["plan"]["gaps_mm"][index]
    folder.commit_step({"index": index, "gap_mm": gap_mm}, {name: data})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run"


def test_a_torn_last_line_is_ignored_and_cut_off(path: Path) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)
    whole = (path / "steps.jsonl").read_bytes()
    (path / "steps.jsonl").write_bytes(whole + b'{"index": 1, "gap_')
    run = read_run(path)
    assert len(run.steps) == 1
    assert any("torn" in warning for warning in run.warnings)
    again = RunFolder.reopen(path)
    assert (path / "steps.jsonl").read_bytes() == whole
    commit(again, 1)
    again.finish("success", "done")
    assert verify_run(path) == []


@given(cut=st.integers(0, 400))
def test_every_cut_of_the_step_file_keeps_the_whole_lines(cut: int) -> None:
    import tempfile

    lines = [json.dumps({"index": i, "note": "ä" * i}) + "\n" for i in range(8)]
    data = "".join(lines).encode()
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "steps.jsonl"
        path.write_bytes(data[:cut])
        found = read_steps(path)
    whole = data[:cut].count(b"\n")
    assert [step["index"] for step in found.steps] == list(range(whole))
    assert found.whole_bytes + len(found.torn) == min(cut, len(data))


def test_damage_before_the_last_line_is_refused(path: Path) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)
    commit(folder, 1)
    text = (path / "steps.jsonl").read_text()
    (path / "steps.jsonl").write_text("#" + text[1:])
    with pytest.raises(StoreError, match=r"line 1: is damaged"):
        read_run(path)
    (path / "steps.jsonl").write_text(text + text)
    with pytest.raises(StoreError, match="step 1 is recorded more than once"):
        read_run(path)


def test_a_step_is_recorded_once(path: Path) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)
    with pytest.raises(StoreError, match="step 1 is recorded already"):
        commit(folder, 0)


def test_foreign_folders_are_left_alone(tmp_path: Path, path: Path) -> None:
    path.mkdir()
    (path / "thesis.tex").write_text("x")
    with pytest.raises(StoreError, match="not an empty folder"):
        RunFolder.create(path, MANIFEST, "plan")
    file = tmp_path / "file"
    file.write_text("x")
    with pytest.raises(StoreError):
        RunFolder.create(file, MANIFEST, "plan")
    with pytest.raises(StoreError, match="no such run folder"):
        read_run(tmp_path / "nowhere")
    with pytest.raises(StoreError, match=r"has no run\.json"):
        read_run(tmp_path)


@pytest.mark.parametrize("at", ["picture", "record", "ending"])
def test_a_full_disk_loses_no_finished_step(path: Path, monkeypatch, at: str) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)

    def full(*_args, **_kwargs):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "disk")

    with monkeypatch.context() as patch:
        if at == "picture":
            patch.setattr(run_folder, "write_bytes", full)
        elif at == "record":
            patch.setattr(run_folder.os, "fsync", full)
        else:
            patch.setattr(run_folder, "write_text", full)
        act = {
            "picture": lambda: commit(folder, 1),
            "record": lambda: commit(folder, 1),
            "ending": lambda: folder.finish("success", "done"),
        }[at]
        with pytest.raises(StoreError, match=r"No space left.*--resume"):
            act()
    run = read_run(path)
    assert [step["index"] for step in run.steps] == [0]
    assert run.status == "cut off"
    assert verify_run(path) == []
    again = RunFolder.reopen(path)
    commit(again, 1)
    again.finish("success", "done")
    assert verify_run(path) == []


LIMITED = """
import resource, signal, sys
from pathlib import Path
from magbend.core.errors import StoreError
from magbend.rig.runs.folder import RunFolder
folder = RunFolder.create(Path(sys.argv[1]), {"plan": {"gaps_mm": [2, 1]}}, "plan")
folder.commit_step({"index": 0, "gap_mm": 2}, {"images/step_000.png": b"x" * 100})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
try:
    folder.commit_step({"index": 1, "gap_mm": 1}, {"images/step_001.png": b"x" * 9999})
except StoreError as error:
    print(error)
    sys.exit(7)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs POSIX limits")
def test_a_disk_that_truly_refuses_leaves_no_half_picture(path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 7, done.stderr
    assert "File too large" in done.stdout
    assert sorted(p.name for p in (path / "images").iterdir()) == ["step_000.png"]
    assert verify_run(path) == []


def test_interrupts_wait_for_the_record(path: Path, monkeypatch) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    plain = run_folder.write_bytes

    def interrupted(target: Path, data: bytes) -> None:
        signal.raise_signal(signal.SIGINT)
        plain(target, data)

    monkeypatch.setattr(run_folder, "write_bytes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        commit(folder, 0)
    assert len(read_run(path).steps) == 1
    assert verify_run(path) == []


@pytest.mark.parametrize(
    ("harm", "problem"),
    [
        (lambda p: (p / "images/step_000.png").unlink(), "step_000.png: missing"),
        (lambda p: (p / "images/step_001.png").write_bytes(b"picturE"), "SHA-256"),
        (
            lambda p: (p / "images/step_001.png").write_bytes(b"pic"),
            "001.png: altered",
        ),
        (lambda p: (p / "images/extra.png").write_bytes(b"x"), "extra.png: extra"),
        (lambda p: (p / "plan.toml").write_text("other"), "plan.toml: altered"),
        (lambda p: (p / "plan.toml").unlink(), "plan.toml: missing"),
        (lambda p: (p / "run.json").unlink(), "no run.json"),
        (lambda p: (p / "run.json").write_text("{"), "run.json: is damaged"),
        (
            lambda p: (p / "steps.jsonl").write_text(
                (p / "steps.jsonl").read_text().replace("70.0", "71.0")
            ),
            "the plan says 70.0",
        ),
        (
            lambda p: (p / "steps.jsonl").write_text(
                (p / "steps.jsonl").read_text().splitlines()[0] + "\n"
            ),
            "step 2: missing from a finished run",
        ),
    ],
)
def test_verify_names_what_is_missing_altered_or_extra(path, harm, problem) -> None:
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)
    commit(folder, 1)
    folder.finish("success", "done")
    assert verify_run(path) == []
    harm(path)
    assert any(problem in line for line in verify_run(path)), verify_run(path)


def test_a_run_begun_anew_leaves_no_half_of_the_attempt_that_was_killed(
    path: Path,
) -> None:
    path.mkdir()
    (path / ".run.json.b3c5011e.tmp").write_text("{")
    folder = RunFolder.create(path, MANIFEST, "plan")
    commit(folder, 0)
    commit(folder, 1)
    folder.finish("success", "done")
    assert verify_run(path) == []
    assert not list(path.glob(".*.tmp"))
