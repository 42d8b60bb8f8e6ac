"""Out to other programs: what is written is read again, and the package is whole."""

from __future__ import annotations

import hashlib
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from analysis_factory import write_run
from typer.testing import CliRunner

from magbend.analysis import (
    Description,
    compare_run,
    load_run,
    read_shapes,
    write_package,
)
from magbend.analysis.compare.export import check_export, export_runs
from magbend.cli.main import app
from magbend.core.errors import InputError
from magbend.core.specimen import Specimen


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "gmc2"
    return compare_run(load_run(write_run(path, sigma_mm=0.01)))


def test_nexus_holds_every_line_with_its_units(run, tmp_path):
    h5py = pytest.importorskip("h5py")
    (path,) = export_runs([run], tmp_path / "a.nxs")
    with h5py.File(path) as file:
        entry = file[file.attrs["default"]]
        assert entry.attrs["NX_class"] == "NXentry"
        assert entry["sample/section_1/E_MPa"][()] == 20.0
        step = entry["step_001"]
        assert step["gap_mm"][()] == 60.0
        assert step["flux_mT"].attrs["units"] == "mT"
        line = step["measured"]
        assert line.attrs["signal"] == "y_mm"
        frame = run.run.frame(run.run.steps[1])
        np.testing.assert_array_equal(line["y_mm"][()], frame.centreline.y_mm)
        np.testing.assert_array_equal(line["sigma_mm"][()], frame.sigma_mm)
        assert line["kappa_per_mm"].attrs["units"] == "per_mm"
        assert {"uniform", "magnet"} <= set(step)


def test_comsols_table_comes_in_again(run, tmp_path):
    (path,) = export_runs([run], tmp_path / "a.txt")
    shapes = read_shapes(path, length_mm=run.run.specimen.length_mm, side=1.0)
    assert len(shapes) == 3
    for shape, step in zip(shapes, run.run.steps, strict=True):
        assert shape.parameters["flux (T)"] == pytest.approx(step.flux_mT * 1e-3)
        line = run.run.frame(step).centreline
        np.testing.assert_allclose(shape.line.points_mm, line.points_mm, atol=1e-9)
        np.testing.assert_allclose(shape.line.theta_rad, line.theta_rad, atol=1e-9)


def test_comsols_table_is_of_one_rod(run, tmp_path):
    other = replace(
        run, run=replace(run.run, specimen=replace(run.run.specimen, name="other"))
    )
    assert isinstance(other.run.specimen, Specimen)
    with pytest.raises(InputError, match="must be of one rod"):
        export_runs([run, other], tmp_path / "a.txt")


def test_points_keep_their_deviations(run, tmp_path):
    export_runs([run], tmp_path / "a.csv")
    head = (tmp_path / "a_points.csv").read_text().splitlines()[0].split(",")
    assert {"sigma_mm", "gap_mm", "flux_mT", "theta_rad"} <= set(head)


def test_an_unknown_ending_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"must end in .*\.nxs.* or be a folder"):
        check_export(tmp_path / "a.docx")


def test_a_package_describes_every_file_it_holds(tmp_path):
    path = write_run(tmp_path / "gmc2")
    (tmp_path / "secret.txt").write_text("secret")
    (path / "link.txt").symlink_to(tmp_path / "secret.txt")
    out = tmp_path / "paper.zip"
    answer = CliRunner().invoke(
        app,
        ["analysis", "package", str(path), "--no-fit", "--author", "A. Name",
         "--author", "B. Name", "--license", "CC-BY-4.0", "--out", str(out), "--json"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    with zipfile.ZipFile(out) as archive:
        names = archive.namelist()
        assert json.loads(answer.stdout)["files"] == len(names)
        crate = json.loads(archive.read("ro-crate-metadata.json"))
        entities = {entity["@id"]: entity for entity in crate["@graph"]}
        root = entities["./"]
        assert root["license"] == "CC-BY-4.0"
        assert [entities[a["@id"]]["name"] for a in root["author"]] == [
            "A. Name", "B. Name"
        ]  # fmt: skip
        parts = {part["@id"] for part in root["hasPart"]}
        assert parts == set(names) - {"ro-crate-metadata.json", "README.txt"}
        for name in parts:
            data = archive.read(name)
            assert hashlib.sha256(data).hexdigest() == entities[name]["sha256"]
            assert entities[name]["contentSize"] == str(len(data))
        assert "runs/gmc2/run.json" in parts
        assert "tables/data_points.csv" in parts
        assert "figures/shapes.pdf" in parts
        assert not [name for name in names if "link" in name]
        text = archive.read("README.txt").decode()
        assert entities["runs/gmc2/run.json"]["sha256"] in text


def test_a_package_on_a_full_disk_is_named_and_leaves_nothing(
    run, tmp_path, monkeypatch
):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("zipfile.ZipFile.writestr", full)
    out = tmp_path / "full" / "paper.zip"
    with pytest.raises(OSError, match="No space left") as failure:
        write_package([run], out, Description(title="x"))
    assert failure.value.filename == str(out)
    assert not list(out.parent.iterdir())


def test_a_package_lies_outside_its_runs_and_is_a_zip(run, tmp_path):
    with pytest.raises(InputError, match=r"must end in \.zip"):
        write_package([run], tmp_path / "a.tar", Description(title="x"))
    with pytest.raises(InputError, match="must not lie in a run"):
        write_package([run], run.run.path / "a.zip", Description(title="x"))
    with pytest.raises(InputError, match="names of their own"):
        write_package([run, run], tmp_path / "a.zip", Description(title="x"))
    assert not list(tmp_path.iterdir())
