"""The programme for a real board: here on the twin's, and on yours if you name it.

    MAGBEND_TEST_PORT=/dev/ttyACM0 MAGBEND_TEST_MM=-2 \
        pytest -m hardware tests/rig/test_board_programme.py -s

``MAGBEND_TEST_MM``: the stretch to move in, in machine mm from where the stage stands,
with its sign. ``MAGBEND_TEST_HOME=1``: home first. ``MAGBEND_TEST_AXIS``: not X.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from magbend.rig.clock import SteppedClock, SystemClock
from magbend.rig.virtual.board.firmware import GrblBoard
from magbend.rig.virtual.board.plant import Plant
from magbend.rig.virtual.protocol_twin import register_board

from .board_programme import Programme
from .stage_bench import SETTINGS


@pytest.mark.parametrize(
    ("settings", "may_home"),
    [(SETTINGS, True), ({22: 0, 20: 0, 21: 0}, False)],
    ids=["switches", "no switches"],
)
@pytest.mark.parametrize("restarts", [False, True], ids=["", "restarts on opening"])
def test_the_programme_passes_on_the_twin(
    settings: dict[int, float], may_home: bool, restarts: bool, tmp_path: Path
) -> None:
    clock = SteppedClock()
    board = GrblBoard(Plant(start_mm=(-5.0, -5.0, -5.0)), settings)
    board.restart_on_open = restarts
    port = register_board("programme", board, clock)
    programme = Programme(port, clock, tmp_path / "wire.log", -2.0, may_home=may_home)
    before_mm = board.plant.carriage_mm[0]
    programme.carry_out()
    assert len(programme.said) == 9 + 3 * may_home
    if not may_home:
        assert board.plant.carriage_mm[0] == pytest.approx(before_mm, abs=1e-6)


@pytest.mark.hardware
def test_the_programme_passes_on_your_board(tmp_path: Path) -> None:
    port, stretch = (
        os.environ.get("MAGBEND_TEST_PORT"),
        os.environ.get("MAGBEND_TEST_MM"),
    )
    if not (port and stretch):
        pytest.fail(
            "name the board and its stretch: MAGBEND_TEST_PORT, MAGBEND_TEST_MM"
        )
    programme = Programme(
        port, SystemClock(), tmp_path / "wire.log", float(stretch),
        may_home=os.environ.get("MAGBEND_TEST_HOME") == "1",
        axis=os.environ.get("MAGBEND_TEST_AXIS", "X"),
    )  # fmt: skip
    try:
        programme.carry_out()
    finally:
        print("", *programme.said, f"wire log: {programme.log_path}", sep="\n")
