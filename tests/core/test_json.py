"""JSON in and out, and the door of every file that a stranger may have written."""

from __future__ import annotations

import json
import math
import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.door import inside, read_file
from magbend.core.errors import ConfigError, StoreError
from magbend.core.json import parse_json, plain, read_json, write_json


def test_what_json_cannot_hold_is_null_and_arrays_are_lists(tmp_path):
    data = {"a": math.nan, "b": [math.inf, 1.5], 3: np.array([1.0, np.nan])}
    write_json(tmp_path / "a.json", data)
    assert read_json(tmp_path / "a.json") == {
        "a": None,
        "b": [None, 1.5],
        "3": [1.0, None],
    }


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(10**30), 10**30)
        | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=20,
    )
)  # fmt: skip
def test_what_is_written_is_read(value):
    assert parse_json(json.dumps(plain(value)).encode()) == value


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[" * 100_000, "nested too deep|not valid JSON"),
        ('{"a":' * 100_000 + "1" + "}" * 100_000, "nested too deep"),
        ("[" * 61 + "]" * 61, "nested too deep"),
        ('{"a": ' + "9" * 400 + "}", "a number of 400 digits"),
        ('{"a": 1e400}', "too large"),
        ('{"a": NaN}', "NaN"),
        ('{"a": 1, "a": 2}', "a key twice"),
        ("[1, 2]", "must hold one JSON object"),
        ('"' + "x" * 1000, "not valid JSON"),
        ("\udcff", "not text in UTF-8"),
    ],
)
def test_hostile_json_is_one_sentence(text, why, tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(StoreError, match=why) as caught:
        read_json(path, kind=StoreError)
    assert len(str(caught.value)) < 400


@pytest.mark.skipif(os.name != "posix", reason="POSIX devices")
@pytest.mark.parametrize("kind", ["pipe", "zero", "folder", "link to a device", "gone"])
def test_only_a_regular_file_is_read_and_nothing_is_waited_for(kind, tmp_path):
    path = tmp_path / "a.json"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "zero":
        path = Path("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "link to a device":
        path.symlink_to("/dev/zero")
    start_s = time.monotonic()
    with pytest.raises(ConfigError):
        read_file(path)
    assert time.monotonic() - start_s < 1.0


def test_a_file_that_is_too_long_is_refused(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 2000)
    assert len(read_file(path, 0.01)) == 2000
    with pytest.raises(ConfigError, match=r"not be longer than 0\.001 MB"):
        read_file(path, 0.001)


@pytest.mark.parametrize(
    "name",
    [
        "",
        "/etc/passwd",
        "../a",
        "a/../../b",
        "a\\b",
        "x\0",
        "n" * 2000,
        "out/a",
    ],
)
def test_a_name_does_not_leave_its_folder(name, tmp_path):
    folder = tmp_path / "run"
    (folder / "images").mkdir(parents=True)
    (tmp_path / "a").touch()
    (folder / "out").symlink_to(tmp_path)
    with pytest.raises(StoreError):
        inside(folder, name, StoreError)
    assert inside(folder, "images/a.png", StoreError) == folder / "images" / "a.png"
