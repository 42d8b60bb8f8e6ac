"""TOML mistakes become one sentence; files are whole or absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from magbend.core.door import file_below, real_path
from magbend.core.errors import ConfigError, InputError
from magbend.core.files import output_file, output_folder, write_bytes
from magbend.core.specimen_file import (
    read_magnet,
    read_specimen,
    specimen_dict,
)
from magbend.core.toml import line_of

GOOD = """\
name = "GMC 2"
side_mm = 1.0
remanence_mT = 20.07

[[section]]
length_mm = 10.0
E_MPa = 20.0

[[section]]
length_mm = 10.0
E_MPa = 15.0
"""


def specimen_error(tmp_path: Path, text: str) -> str:
    path = tmp_path / "rod.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_specimen(path)
    message = str(caught.value)
    assert "\n" not in message
    assert "rod.toml" in message
    return message


def test_a_specimen_survives_the_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "rod.toml"
    path.write_text(GOOD, encoding="utf-8")
    specimen = read_specimen(path)
    assert specimen.length_mm == 20.0
    assert specimen.joints_mm == (10.0,)
    import json

    path.write_text(json.dumps(specimen_dict(specimen)), encoding="utf-8")
    assert read_specimen(path) == specimen


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("side_mm = 1.0", "side = 1.0", ["line 2", "'side'", "unit", "'side_mm'"]),
        ("side_mm = 1.0", "sidemm = 1.0", ["line 2", "did you mean 'side_mm'"]),
        ("side_mm = 1.0", "", ["'side_mm' is missing"]),
        ("side_mm = 1.0", "diameter_mm = 1.0", ["is missing", 'shape = "round"']),
        ("side_mm", "bore_mm = 0.5\ndiameter_mm", ["is missing", 'shape = "tube"']),
        ("side_mm = 1.0", "side_mm = 1.0\ncolour = 'tan'", ["#c8af8c", "'tan'"]),
        ("side_mm = 1.0", "side_mm = 1.0\npoisson_ratio = 5", ["-0.99 to 0.5", "5"]),
        ("E_MPa = 15.0", "E_MPa = -15.0", ["line 11", "E_MPa", "-15.0"]),
        ("E_MPa = 15.0", "E_MPa = nan", ["line 11", "E_MPa", "finite"]),
        ("E_MPa = 15.0", 'E_MPa = "soft"', ["line 11", "E_MPa", "'soft'"]),
        ("E_MPa = 15.0", 'E_MPa = "15.0"', ["line 11", "E_MPa", "without quotes"]),
        ("side_mm = 1.0", "side_mm = true", ["line 2", "side_mm", "must be a number"]),
        ("E_MPa = 15.0", "E_MPa = ", ["not valid TOML", "line 11"]),
        ("E_MPa = 15.0", "Emod_MPa = 15.0", ["line 11", "unknown key", "E_MPa"]),
    ],
)
def test_mistakes_are_named_with_their_line(
    tmp_path: Path, old: str, new: str, parts: list[str]
) -> None:
    message = specimen_error(tmp_path, GOOD.replace(old, new))
    for part in parts:
        assert part in message


def test_a_rod_without_sections_is_refused(tmp_path: Path) -> None:
    assert "section" in specimen_error(tmp_path, GOOD.split("\n\n")[0])
    assert "section" in specimen_error(tmp_path, GOOD.split("\n\n")[0] + "\nsection=[]")


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_specimen(tmp_path / "absent.toml")
    with pytest.raises(ConfigError, match=r"folder|cannot be read"):
        read_specimen(tmp_path)


def test_a_magnet_takes_one_side_or_three(tmp_path: Path) -> None:
    path = tmp_path / "magnet.toml"
    path.write_text("side_mm = 55.0\nremanence_T = 1.305\n", encoding="utf-8")
    assert read_magnet(path).sides_mm == (55.0, 55.0, 55.0)
    path.write_text("remanence_T = 1.305\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="side_mm"):
        read_magnet(path)


def test_lines_are_found_in_nested_tables() -> None:
    text = "a = 1\n[t]\nb = 2\n[[s]]\nc = 1\n[[s]]\nc = 2\n"
    assert line_of(text, ("a",)) == 1
    assert line_of(text, ("t", "b")) == 3
    assert line_of(text, ("s", 0, "c")) == 5
    assert line_of(text, ("s", 1, "c")) == 7
    assert line_of(text, ("s", 1, "missing")) == 6


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "record.json"
    write_bytes(path, b"old")

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["record.json"]


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_bytes(pipe, b"new")
        assert os.read(reader, 10) == b"new"
    finally:
        os.close(reader)
    assert pipe.is_fifo()


def test_a_byte_order_mark_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "rod.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert read_specimen(path).length_mm == 20.0


def test_a_place_that_cannot_be_written_is_named_as_the_user_named_it(
    tmp_path: Path,
) -> None:
    with pytest.raises(FileNotFoundError, match="make it first") as caught:
        write_bytes(tmp_path / "absent" / "shape.csv", b"new")
    assert caught.value.filename == str(tmp_path / "absent" / "shape.csv")
    with pytest.raises(InputError, match="must have a name"):
        write_bytes(tmp_path, b"new")
    with pytest.raises(InputError, match="must have a name"):
        write_bytes(Path(), b"new")
    assert list(tmp_path.iterdir()) == []


def test_an_output_is_checked_before_the_work_and_its_folders_made(
    tmp_path: Path,
) -> None:
    path = tmp_path / "new" / "deep" / "shape.csv"
    assert output_file(path) == path
    assert path.parent.is_dir()
    assert not path.exists()
    path.write_text("a file")
    with pytest.raises(InputError, match="a file stands where a folder belongs"):
        output_file(path / "below.csv")
    with pytest.raises(InputError, match="a file stands where a folder belongs"):
        output_folder(path)
    with pytest.raises(InputError, match="must have a name"):
        output_file(path.parent)
    output_file(Path(os.devnull))


def test_an_output_replaces_no_file_of_another_kind_and_none_that_is_read(
    tmp_path: Path,
) -> None:
    photo, table = tmp_path / "plane.png", tmp_path / "shape.csv"
    photo.write_text("a photograph")
    output_file(table, kind=".csv", taken=[table])
    table.write_text("a table")
    assert output_file(table, kind=".csv", taken=[photo]) == table
    with pytest.raises(InputError, match=r"is no \.csv file"):
        output_file(photo, kind=".csv")
    link = tmp_path / "link.csv"
    link.symlink_to(table)
    with pytest.raises(InputError, match="is read, or written as something else"):
        output_file(link, taken=[table])


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The superuser may write anywhere, so the system's answer is stood in for.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match="nothing may be written in this folder"):
        output_file(tmp_path / "shape.csv")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_that_nobody_reads_is_refused_and_not_waited_for(tmp_path):
    pipe = tmp_path / "comparison.csv"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="a pipe that nobody reads"):
        write_bytes(pipe, b"x")
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_bytes(pipe, b"x")
    assert os.read(reader, 9) == b"x"
    os.close(reader)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (GOOD.replace("GMC 2", r"GMC \u001b[31m"), "line 1: name: .* control char"),
        (GOOD.replace("GMC 2", r"GMC \u202e"), "line 1: name: .* control char"),
        ("side_mm = 1" + 5000 * "0", "number of too many digits$"),
        ("a = " + 3000 * "[" + 3000 * "]", "nested too deep$"),
    ],
)
def test_what_would_steer_a_terminal_or_the_reader_is_one_sentence(
    tmp_path, text, match
):
    path = tmp_path / "rod.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=match):
        read_specimen(path)


def test_a_strangers_name_leads_to_a_file_below_or_to_none(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    (folder / "deeper").mkdir(parents=True)
    for name in ("a.csv", "deeper/b.csv", "../outside.csv"):
        (folder / name).write_text("x")
    assert file_below(folder, "a.csv") == folder / "a.csv"
    assert file_below(folder, "deeper/../deeper/b.csv") == folder / "deeper/b.csv"
    for name in ("../outside.csv", "deeper", "", "n" * 5000, "a\0.csv", "/etc/passwd"):
        assert file_below(folder, name) is None
    if os.name == "posix":
        (folder / "ring").symlink_to("ring")
        (folder / "out").symlink_to("../outside.csv")
        assert file_below(folder, "ring") is None
        assert file_below(folder, "out") is None
        assert real_path(folder / "ring") == folder / "ring"
