"""The paper's numbers, the probe model, and what the audit says of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import magpylib
import numpy as np
import pytest
from analysis_factory import write_run

from magbend import sim
from magbend.analysis import compare_run, load_run
from magbend.analysis.paper.audit import audit_paper, write_audit
from magbend.analysis.paper.field_claims import end_face_share
from magbend.analysis.paper.finding import Finding
from magbend.analysis.paper.paper import gmc_numbers, reproduce
from magbend.analysis.paper.probe import (
    fit_standoff,
    from_probe_reading,
    probe_factor,
    read_probe_csv,
    remanence_from_probe_mT,
)
from magbend.core.errors import ConfigError, InputError


def bar(side_mm: float, length_mm: float) -> magpylib.magnet.Cuboid:
    """Return a bar of remanence 1 T along z, its end face at z = 0."""
    return magpylib.magnet.Cuboid(
        polarization=(0.0, 0.0, 1.0),
        dimension=(side_mm * 1e-3, side_mm * 1e-3, length_mm * 1e-3),
        position=(0.0, 0.0, -0.5e-3 * length_mm),
    )


@pytest.mark.parametrize("standoff_mm", [0.05, 0.46, 2.0, 20.0])
def test_probe_reads_the_flux_of_a_bar(standoff_mm: float) -> None:
    flux = magpylib.getB(bar(1.25, 30.0), (0.0, 0.0, standoff_mm * 1e-3))[2]
    assert probe_factor(1.25, 30.0, standoff_mm) == pytest.approx(flux, rel=1e-9)


def test_standoff_explains_the_papers_magnetisations() -> None:
    found = fit_standoff(*read_probe_csv(None))
    assert found.remanence_mT == pytest.approx(111.0, abs=0.5)
    assert found.standoff_mm == pytest.approx(0.46, abs=0.005)
    assert np.abs(found.residual_percent).max() < 0.9
    assert found.constant_percent > 20.0
    assert found.power == pytest.approx(1.06, abs=0.01)


def test_standoff_is_recovered_from_made_up_readings() -> None:
    sides = [0.8, 1.0, 1.3, 2.0]
    readings = [90.0 * probe_factor(side, 25.0, 0.7) for side in sides]
    found = fit_standoff(sides, readings, [25.0] * 4)
    assert found.remanence_mT == pytest.approx(90.0, rel=1e-6)
    assert found.standoff_mm == pytest.approx(0.7, rel=1e-6)
    back = remanence_from_probe_mT(
        readings[1], side_mm=1.0, length_mm=25.0, standoff_mm=0.7
    )
    assert back == pytest.approx(90.0, rel=1e-9)


def test_run_read_as_probe_keeps_its_shapes(tmp_path: Path) -> None:
    run = load_run(write_run(tmp_path / "a"))
    other = from_probe_reading(run, 0.46)
    assert other.specimen.remanence_mT == pytest.approx(5.5 * 20.07, rel=0.02)
    done = compare_run(other).of("magnet")
    assert all(c.errors is not None and c.errors.rms_mm < 1e-5 for c in done)


def test_probe_refuses_what_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="two sides"):
        fit_standoff([1.0, 1.0], [20.0, 21.0], [30.0, 30.0])
    with pytest.raises(InputError, match="standoff_mm"):
        probe_factor(1.0, 30.0, -0.1)
    table = tmp_path / "readings.csv"
    table.write_text("side,reading\n1,2\n")
    with pytest.raises(ConfigError, match="head it side_mm"):
        read_probe_csv(table)


@pytest.fixture(scope="module")
def findings() -> tuple[Finding, ...]:
    return audit_paper()


def test_audit_computes_its_verdicts(findings: tuple[Finding, ...]) -> None:
    by_claim = {finding.claim: finding for finding in findings}
    verdicts = [finding.verdict for finding in findings[1:4]]
    assert verdicts == ["reproduced", "reproduced", "differs"]
    values = [round(finding.value, 4) for finding in findings[1:4]]
    assert values == [1.3578, 1.3050, 1.2186]
    assert "70.07 mT" in findings[3].evidence
    weight = by_claim["the rod's weight is left out"]
    assert weight.value == pytest.approx(-35.0, abs=1.5)
    field = next(f for f in findings if "uniform field" in f.claim)
    assert field.value == pytest.approx(30.8, abs=0.1)
    assert all(finding.evidence for finding in findings)


@pytest.mark.parametrize(
    ("words", "value", "off", "verdict", "says"),
    [
        ("more circular", 0.850, 0.004, "reproduced", "0.805 for GMC 6"),
        ("readings of one magnet", 20.0, 1.0, "differs", "which no magnet has"),
        ("sides of 0.75", -11.2, 0.1, "matters", "1 to 0.97 mm: tip +5.9 %"),
        ("one recipe", 6.6, 0.1, "matters", "stated nowhere"),
        ("200, 150 and 100 %", 175.0, 1.0, "supports", "1.00/0.80/0.57"),
        ("2:1, 5:1 and 6:1", 20.0, 12.0, "differs", "nearly one material"),
        ("lie within 8 to 50", 7.5, 0.0, "differs", "7.5 to 20 MPa"),
        ("outer diameters", 33.3, 0.1, "matters", "square"),
        ("all 27 sets", 21.0, 0.0, "differs", "Nothing makes ten"),
        ("Eqs. 1 to 4", 38.3145, 1e-3, "negligible", "(Y0 + y)"),
        ("mean squared error", 0.37, 0.03, "matters", "no unit"),
        ("Table 1", math.nan, 0.0, "differs", "sides"),
    ],
)
def test_audit_says_what_the_paper_leaves_out(
    findings: tuple[Finding, ...],
    words: str,
    value: float,
    off: float,
    verdict: str,
    says: str,
) -> None:
    (finding,) = [f for f in findings if words in f.claim]
    assert finding.verdict == verdict
    assert says in finding.claim + finding.evidence
    assert finding.value == pytest.approx(value, abs=off, nan_ok=True)


def test_the_papers_first_claim_stands_up_front(
    findings: tuple[Finding, ...],
) -> None:
    assert "circular" in findings[0].claim


def test_end_face_carries_half_by_an_independent_field() -> None:
    """Average magpylib's normal flux over the face, just outside it."""
    t, w = np.polynomial.legendre.leggauss(200)
    x, y = np.meshgrid(0.5e-3 * t, 0.5e-3 * t)
    shares = []
    for height in (4e-7, 2e-7):
        points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
        normal = magpylib.getB(bar(1.0, 30.0), points)[:, 2]
        shares.append(float(np.outer(w, w).ravel() @ normal) / 4.0)
    on_the_face = 2.0 * shares[1] - shares[0]
    assert end_face_share() == pytest.approx(on_the_face, abs=3e-4)
    assert end_face_share() == pytest.approx(0.5, abs=1e-3)


def test_audit_page_stands_alone(findings: tuple[Finding, ...], tmp_path: Path) -> None:
    write_audit(tmp_path / "audit.html", findings)
    text = (tmp_path / "audit.html").read_text()
    assert "1.2186 T" in text
    assert "http" not in text


def test_runs_are_sorted_into_the_papers_panels(tmp_path: Path) -> None:
    runs = [
        compare_run(
            load_run(write_run(tmp_path / f"{n}", specimen=sim.gmc(n), gaps_mm=[60.0]))
        )
        for n in (2, 4, 5)
    ]
    assert sorted(gmc_numbers(runs)) == [2, 4, 5]
    assert gmc_numbers(runs[:2]) == {}
    other = replace(sim.gmc(2), name="my rod")
    alone = compare_run(load_run(write_run(tmp_path / "own", specimen=other)))
    assert gmc_numbers([alone]) == {}


@pytest.mark.slow
def test_the_paper_is_reproduced(tmp_path: Path) -> None:
    """21 photographs, 27 comparisons; the magnet beats the uniform field."""
    result = reproduce(tmp_path / "paper", seed=3)
    data = result.as_dict()
    assert (data["steps"], data["comparisons"]) == (21, 27)
    assert data["median_rms_mm"]["magnet"] < 0.5 * data["median_rms_mm"]["uniform"]
    assert (tmp_path / "paper" / "figures" / "comparison.pdf").is_file()
