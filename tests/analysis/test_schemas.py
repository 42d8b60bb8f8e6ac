"""Editors know the files: the schemas accept what we ship and refuse what we refuse."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from magbend.analysis.examples import copy_examples
from magbend.analysis.schemas import KINDS, RECORDS, toml_schema, write_toml_schemas
from magbend.core.errors import InputError, StoreError

FIXTURES = Path(__file__).parents[2] / "fixtures"
FILES = [
    ("specimen", FIXTURES / "specimens" / "gmc2.toml"),
    ("rig", FIXTURES / "plans" / "rig.toml"),
    ("plan", FIXTURES / "plans" / "plan.toml"),
    ("space", FIXTURES / "library" / "million.toml"),
]


def wrong(kind: str, data: object) -> list[str]:
    validator = Draft202012Validator(json.loads(json.dumps(toml_schema(kind))))
    return [error.message for error in validator.iter_errors(data)]


@pytest.mark.parametrize(("kind", "path"), FILES, ids=[kind for kind, _ in FILES])
def test_shipped_files_fit_their_schema(kind: str, path: Path) -> None:
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    assert wrong(kind, data) == []
    assert any("no_such_key" in said for said in wrong(kind, data | {"no_such_key": 1}))


def test_every_schema_is_one(tmp_path: Path) -> None:
    paths = write_toml_schemas(tmp_path / "new")
    assert len(paths) == len(KINDS) + len(RECORDS)
    for path in paths:
        Draft202012Validator.check_schema(json.loads(path.read_text(encoding="utf-8")))


def test_an_unknown_kind_is_one_sentence() -> None:
    with pytest.raises(InputError, match="there are specimen, magnet"):
        toml_schema("rod")
    with pytest.raises(InputError, match="say which schema; there are"):
        toml_schema("")


def test_examples_are_copied_once(tmp_path: Path) -> None:
    paths = {path.relative_to(tmp_path / "x") for path in copy_examples(tmp_path / "x")}
    wanted = {
        "simulate_a_shape.py", "library/million.toml", "specimens/gmc2.toml",
        "lumens/bend90.toml", "lumens/fork.toml",
        "photographs/calib_D.jpg", "photographs/dev_10.jpg",
    }  # fmt: skip
    assert {Path(name) for name in wanted} <= paths
    with pytest.raises(StoreError, match="is there already"):
        copy_examples(tmp_path / "x")
