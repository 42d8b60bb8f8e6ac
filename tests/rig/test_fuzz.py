"""Changed records and pictures are read, or refused with a sentence; never more."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

from magbend.core.errors import MagbendError
from magbend.core.picture import decode_picture
from magbend.rig import check_run, migrate_run

RUN = Path(__file__).parents[2] / "fixtures" / "runs" / "format_1_finished"
NAMES = (
    "run.json",
    "end.json",
    "steps.jsonl",
    "manifest.json",
    "wire.log",
    "plan.toml",
)


def changed(data: bytes, generator: random.Random) -> bytes:
    """Return bytes with one to five of them replaced, taken out or put in."""
    new = bytearray(data)
    for _ in range(generator.randrange(1, 6)):
        at = generator.randrange(len(new))
        act = generator.randrange(3)
        if act == 0:
            new[at] = generator.randrange(256)
        elif act == 1:
            del new[at : at + generator.randrange(1, 40)]
        else:
            new[at:at] = generator.randbytes(generator.randrange(1, 40))
    return bytes(new)


@pytest.mark.parametrize("count", [120, pytest.param(6000, marks=pytest.mark.slow)])
def test_a_changed_file_is_never_taken_for_good_and_never_a_traceback(count, tmp_path):
    generator = random.Random(count)
    run = tmp_path / "run"
    shutil.copytree(RUN, run)
    migrate_run(run)
    assert check_run(run).problems == ()
    good = {name: (run / name).read_bytes() for name in NAMES}
    for turn in range(count):
        name = NAMES[turn % len(NAMES)]
        data = changed(good[name], generator)
        (run / name).write_bytes(data)
        check = check_run(run)
        bad = [one.name for one in check.files if one.status != "good"]
        assert data == good[name] or bad or check.problems, (name, turn)
        assert all("\n" not in sentence for sentence in check.problems)
        (run / name).write_bytes(good[name])


@pytest.mark.parametrize("count", [150, pytest.param(14_000, marks=pytest.mark.slow)])
def test_a_changed_picture_is_decoded_or_refused(count):
    generator = random.Random(count)
    png = (RUN / "images" / "step_000.png").read_bytes()
    for _ in range(count):
        data = changed(png[: generator.randrange(100, 4000)], generator)
        with pytest.raises(MagbendError):
            decode_picture(data, "x", MagbendError)
