"""``magbend analysis compare|report|paper|audit|probe``: runs and theory."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..core.errors import InputError, MagbendError
from ..core.progress import silent
from .analysis_show import print_comparison
from .console import JSON, print_json, progress, say
from .run_options import (
    CLAMP,
    GRAVITY,
    LOAD,
    MAGNET,
    RUNS,
    UNVERIFIED,
    choice,
    loaded_runs,
    outputs,
    support_of,
    tell_left_out,
)

if TYPE_CHECKING:
    from ..analysis import RunComparison, RunData


def register(app: typer.Typer) -> None:
    """Add the commands to the group."""
    for command, example in (
        (compare, "magbend analysis compare runs/gmc2"),
        (report, "magbend analysis report runs/gmc2"),
        (paper, "magbend analysis paper --out paper"),
        (audit, "magbend analysis audit"),
        (probe, "magbend analysis probe --reading-mT 20.07 --side-mm 1.0"),
    ):
        app.command(epilog=f"Example: {example}")(command)


def compare(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(
        None, "--out", help="One table of all runs, besides RUN/comparison.csv."
    ),
    model: str = typer.Option("rod", "--model", help="rod or solid."),
    refit: bool = typer.Option(
        False, "--refit", help="Also compare each model with the moduli it finds."
    ),
    clamp_angle_deg: float = CLAMP,
    gravity_m_s2: tuple[float, float, float] = GRAVITY,
    load_factor: float = LOAD,
    magnet: Path = MAGNET,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Compare measured with simulated centrelines; write comparison.csv."""
    from ..analysis import check_any, comparison_table, with_refitted, write_comparison

    choice(model, ("rod", "solid"), "--model")
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    outputs(out, *(run.path / "comparison.csv" for run in loaded))
    done = compared(
        loaded, left_out, model, clamp_angle_deg, gravity_m_s2, load_factor, magnet
    )
    if refit:
        done = [with_refitted(run, theory=model) for run in done]
    for run in done:
        write_comparison(run.run.path / "comparison.csv", [run])
    if out is not None:
        write_comparison(out, done)
    table = comparison_table(done)
    if json:
        print_json(table.to_dict("records"))
    else:
        print_comparison(table)
    tell_left_out(left_out, len(done))
    check_any(done)


def report(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(
        None, "--out", help="The page; RUN/report.html or report.html if not given."
    ),
    title: str = typer.Option("", "--title", help="Title of the page."),
    no_fit: bool = typer.Option(False, "--no-fit", help="Leave the fit out."),
    model: str = typer.Option("rod", "--model", help="rod or solid."),
    clamp_angle_deg: float = CLAMP,
    gravity_m_s2: tuple[float, float, float] = GRAVITY,
    load_factor: float = LOAD,
    magnet: Path = MAGNET,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Write one self-contained HTML page, with the figures as PDF beside it."""
    from ..analysis import gmc_numbers, try_fit, write_comparison
    from ..analysis.report import write_report

    choice(model, ("rod", "solid"), "--model")
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    path = out or (
        loaded[0].path / "report.html" if len(loaded) == 1 else Path("report.html")
    )
    outputs(path, *(run.path / "comparison.csv" for run in loaded))
    done = compared(
        loaded, left_out, model, clamp_angle_deg, gravity_m_s2, load_factor, magnet
    )
    fits = [
        None if no_fit else try_fit(run.run, run.support, run.sources) for run in done
    ]
    with progress("report") as tell:
        files = write_report(
            done,
            path,
            fits=fits,
            title=title,
            by_number=gmc_numbers(done),
            left_out=left_out,
            progress=tell,
        )
    for run in done:
        write_comparison(run.run.path / "comparison.csv", [run])
    failed = [c for run in done for c in run.of("magnet") if not c.ok]
    if json:
        print_json(
            {
                "html": str(files.html),
                "figures": [str(path) for path in files.figures],
                "runs": len(done),
                "failed_steps": len(failed),
                "left_out": left_out,
            }
        )
        return
    for comparison in failed:
        say(
            f"{comparison.run}, step {comparison.step.index + 1}: {comparison.status}",
            err=True,
        )
    tell_left_out(left_out, len(done))
    say(str(files.html))


def paper(
    out: Path = typer.Option(Path("paper"), "--out", help="Folder for the runs."),
    seed: int = typer.Option(1, "--seed", min=0, help="Of the twin's hidden truth."),
    workers: int = typer.Option(
        2, "--workers", min=1, help="Benches that run side by side."
    ),
    json: bool = JSON,
) -> None:
    """Run the paper's seven GMCs at three fields on the twin bench, and report."""
    from ..analysis import reproduce

    with progress("paper") as tell:
        result = reproduce(out, seed=seed, workers=workers, progress=tell)
    if json:
        print_json(result.as_dict())
        return
    say(result.sentence())
    say(str(result.html))


def audit(
    out: Path = typer.Option(None, "--out", help="Also write the page as HTML."),
    json: bool = JSON,
) -> None:
    """Check the paper's own numbers; one verdict each, computed here."""
    from ..analysis import audit_paper, write_audit

    if out is not None:
        outputs(out)
    findings = audit_paper()
    if out is not None:
        write_audit(out, findings)
    if json:
        print_json([finding.as_dict() for finding in findings])
        return
    for finding in findings:
        say(f"{finding.verdict.upper():12} {finding.claim}")
        say(f"{'':12} {finding.evidence}\n")


def probe(
    readings: Path = typer.Argument(
        None, help="CSV with side_mm, reading_mT[, length_mm]; the paper's if none."
    ),
    reading_mT: float = typer.Option(None, "--reading-mT", help="One reading."),
    side_mm: float = typer.Option(None, "--side-mm", help="Side of its rod."),
    standoff_mm: float = typer.Option(
        None, "--standoff-mm", help="Stand-off; fitted to the paper's if not given."
    ),
    length_mm: float = typer.Option(30.0, "--length-mm", help="Length of its rod."),
    json: bool = JSON,
) -> None:
    """Turn readings of a surface probe into remanences, by the stand-off."""
    from ..analysis import (
        fit_standoff,
        read_probe_csv,
        remanence_from_probe_mT,
    )

    if (reading_mT is None) != (side_mm is None):
        raise InputError("give --reading-mT and --side-mm together, or neither")
    found = fit_standoff(*read_probe_csv(readings))
    if reading_mT is not None and side_mm is not None:
        standoff = found.standoff_mm if standoff_mm is None else standoff_mm
        remanence = remanence_from_probe_mT(
            reading_mT, side_mm=side_mm, length_mm=length_mm, standoff_mm=standoff
        )
        if json:
            print_json({"remanence_mT": remanence, "standoff_mm": standoff})
        else:
            say(f"remanence {remanence:.1f} mT at a stand-off of {standoff:.3f} mm")
        return
    if json:
        print_json(found.as_dict())
        return
    for line in found.lines():
        say(line)


def compared(
    loaded: Sequence[RunData],
    left_out: list[str],
    model: str,
    clamp_angle_deg: float = 0.0,
    gravity_m_s2: tuple[float, float, float] | None = None,
    load_factor: float = 1.0,
    magnet: Path | None = None,
) -> list[RunComparison]:
    """Compare each run; add a sentence to `left_out` on each that cannot be."""
    from ..analysis import compare_run
    from ..sim import read_field

    sources = read_field(magnet) if magnet is not None else None
    done, errors = [], []
    with progress("compare") if len(loaded) > 4 else nullcontext(silent) as tell:
        for number, run in enumerate(loaded, start=1):
            support = support_of(
                run.support, clamp_angle_deg, gravity_m_s2, load_factor
            )
            try:
                done.append(
                    compare_run(run, support=support, model=model, sources=sources)
                )
            except MagbendError as error:
                errors.append(error)
                left_out.append(f"{run.path}: {error}")
            tell(number, len(loaded))
    if not done:
        raise errors[0]
    return done
