"""What ``set-gap`` writes into a rig file, and what it leaves alone."""

from __future__ import annotations

import pytest

from magbend.core.errors import ConfigError
from magbend.rig.bench.config import read_rig
from magbend.rig.bench.file_edit import write_measured_gap
from magbend.rig.bench.template import write_templates

MEASURED = {
    "gap_mm": 70.2, "machine_mm": -30.0, "direction_tested": True,
    "firmware": "VER:1.1h.20190830:", "settings": {"$100": "250.000"},
}  # fmt: skip


def test_every_other_byte_of_the_rig_file_stays(tmp_path):
    path = tmp_path / "rig.toml"
    text = (
        "[stage]\n  gap_at_zero_mm = 1.5e2 # here\nport = 'x'\n[limits]\nmin_gap_mm=1\n"
    )
    path.write_text(text)
    write_measured_gap(path, 99.25, 1, MEASURED)
    head, _, table = path.read_text().partition("\n[stage.measured]")
    assert head == text.replace("1.5e2", "99.250")
    assert '"$100" = "250.000"' in table


def test_a_file_without_a_zero_gets_one_and_a_second_time_replaces_all(tmp_path):
    write_templates(tmp_path)
    path = tmp_path / "rig.toml"
    assert read_rig(path).stage.gap_at_zero_mm is None
    write_measured_gap(path, 99.25, -1, MEASURED)
    once = path.read_text()
    write_measured_gap(path, 101.5, 1, MEASURED)
    stage = read_rig(path).stage
    assert (stage.gap_at_zero_mm, stage.direction) == (101.5, 1)
    assert stage.measured is not None
    assert stage.measured.settings == {"$100": "250.000"}
    assert path.read_text().count("[stage.measured]") == 1
    assert once.replace("99.250", "101.500").replace(
        "direction = -1", "direction = 1"
    ) == path.read_text()  # fmt: skip


def test_a_file_without_a_table_of_its_own_is_left_alone(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("stage = { port = 'x' }\n")
    with pytest.raises(ConfigError, match="on a line of its own"):
        write_measured_gap(path, 1.0, 1, MEASURED)
    assert path.read_text() == "stage = { port = 'x' }\n"
