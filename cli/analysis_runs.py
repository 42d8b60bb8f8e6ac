"""``magbend analysis compare|fit|report|export|paper|audit|probe``: runs and theory."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..core.errors import InputError, MagbendError
from ..core.progress import silent
from .analysis_show import print_comparison, print_fit
from .console import JSON, print_json, progress

if TYPE_CHECKING:
    from ..analysis.compare.compare import RunComparison
    from ..analysis.runs.load import RunData
    from ..sim import Support

_RUNS = typer.Argument(..., help="Run folders, or folders of runs.")
_CLAMP = typer.Option(0.0, "--clamp-angle-deg", help="Direction of the clamp.")
_GRAVITY = typer.Option(
    None,
    "--gravity-m-s2",
    help="Weight x y z in the specimen frame instead of [bench] of the rig file; "
    "0 0 -9.81 is a bench seen from above.",
)
_LOAD = typer.Option(1.0, "--load-factor", help="Factor on the magnetic load.")
_UNVERIFIED = typer.Option(
    False, "--unverified", help="Go on with runs whose files were altered; say which."
)


def register(app: typer.Typer) -> None:
    """Add the commands to the group."""
    for command, example in (
        (compare, "magbend analysis compare runs/gmc2"),
        (fit, "magbend analysis fit runs/gmc2 --json"),
        (report, "magbend analysis report runs/gmc2"),
        (export, "magbend analysis export runs/gmc2 --out gmc2.mat"),
        (paper, "magbend analysis paper --out paper"),
        (audit, "magbend analysis audit"),
        (probe, "magbend analysis probe --reading-mT 20.07 --side-mm 1.0"),
    ):
        app.command(epilog=f"Example: {example}")(command)


def compare(
    runs: list[Path] = _RUNS,
    out: Path = typer.Option(
        None, "--out", help="One table of all runs, besides RUN/comparison.csv."
    ),
    model: str = typer.Option("rod", "--model", help="rod or solid."),
    clamp_angle_deg: float = _CLAMP,
    gravity_m_s2: tuple[float, float, float] = _GRAVITY,
    load_factor: float = _LOAD,
    unverified: bool = _UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Compare measured with simulated centrelines; write comparison.csv."""
    from ..analysis.compare.compare import check_any, comparison_table, write_comparison

    _choice(model, ("rod", "solid"), "--model")
    loaded, left_out = _loaded(runs, unverified=unverified)
    _outputs(out, *(run.path / "comparison.csv" for run in loaded))
    done = _compared(
        loaded, left_out, model, clamp_angle_deg, gravity_m_s2, load_factor
    )
    for run in done:
        write_comparison(run.run.path / "comparison.csv", [run])
    if out is not None:
        write_comparison(out, done)
    table = comparison_table(done)
    if json:
        print_json(table.to_dict("records"))
    else:
        print_comparison(table)
    _tell_left_out(left_out, len(done))
    check_any(done)


def fit(
    runs: list[Path] = _RUNS,
    out: Path = typer.Option(
        None, "--out", help="fit.json; in the first run folder if not given."
    ),
    field: str = typer.Option("magnet", "--field", help="magnet or uniform."),
    model: str = typer.Option("rod", "--model", help="rod or solid."),
    free: list[str] = typer.Option(
        [],
        "--free",
        help="Also fit remanence_mT, load_factor or magnet_remanence_T; repeatable.",
    ),
    hold: list[str] = typer.Option(
        [],
        "--hold",
        help="Hold a nuisance, such as gap_mm or side_percent (docs/analysis.md has "
        "them all), or all; repeatable.",
    ),
    prior: list[str] = typer.Option(
        [], "--prior", help="Prior sd of a nuisance: NAME=SD; repeatable."
    ),
    range_MPa: tuple[float, float] = typer.Option(
        None, "--prior-range-MPa", help="95 % prior range of a modulus (paper: 8 50)."
    ),
    bounds_MPa: tuple[float, float] = typer.Option(
        None, "--bounds-MPa", help="Hard bounds of the moduli."
    ),
    falling: bool = typer.Option(
        False, "--falling", help="Moduli must fall from root to tip."
    ),
    probe_standoff_mm: float = typer.Option(
        None,
        "--probe-standoff-mm",
        help="Take the specimen's remanence as a probe reading at this stand-off.",
    ),
    posterior: int = typer.Option(
        0, "--posterior", help="Also sample the posterior: steps per walker (emcee)."
    ),
    seed: int = typer.Option(0, "--seed", help="Of the posterior's walkers."),
    clamp_angle_deg: float = _CLAMP,
    gravity_m_s2: tuple[float, float, float] = _GRAVITY,
    load_factor: float = _LOAD,
    unverified: bool = _UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Fit the moduli with uncertainties; write fit.json."""
    from ..analysis import (
        check_installed,
        common_support,
        fit_runs,
        sample_posterior,
        write_fit,
    )
    from ..analysis.paper.probe import from_probe_reading
    from ..core.derived import note_derived
    from ..sim import Support

    _choice(field, ("magnet", "uniform"), "--field")
    _choice(model, ("rod", "solid"), "--model")
    if (field, model) == ("uniform", "solid"):
        raise InputError("--model solid needs the magnet's field; leave --field out")
    nuisance = _nuisance(hold, prior)
    if posterior:
        check_installed()
    loaded, left_out = _loaded(runs, unverified=unverified)
    path = out or loaded[0].path / "fit.json"
    _outputs(path)
    if probe_standoff_mm is not None:
        loaded = [from_probe_reading(run, probe_standoff_mm) for run in loaded]
    told = Support() if gravity_m_s2 else common_support(loaded)
    result = fit_runs(
        loaded,
        model="solid" if model == "solid" else field,
        free=free,
        nuisance=nuisance,
        support=_support(told, clamp_angle_deg, gravity_m_s2, load_factor),
        prior_MPa=range_MPa,
        bounds_MPa=bounds_MPa,
        falling=falling,
    )
    sampled = None
    if posterior:
        with progress("posterior") as tell:
            sampled = sample_posterior(
                result, steps=posterior, seed=seed, progress=tell
            )
    write_fit(path, result, sampled)
    used = [file for run in loaded for file in run.files]
    note_derived([path], sources=used, command="analysis fit")
    data = result.as_dict()
    if sampled is not None:
        data["posterior"] = sampled.as_dict()
    if json:
        print_json(data)
    else:
        print_fit(result, path, data.get("posterior"))
    _tell_left_out(left_out, len(loaded))


def report(
    runs: list[Path] = _RUNS,
    out: Path = typer.Option(
        None, "--out", help="The page; RUN/report.html or report.html if not given."
    ),
    title: str = typer.Option("", "--title", help="Title of the page."),
    no_fit: bool = typer.Option(False, "--no-fit", help="Leave the fit out."),
    model: str = typer.Option("rod", "--model", help="rod or solid."),
    clamp_angle_deg: float = _CLAMP,
    gravity_m_s2: tuple[float, float, float] = _GRAVITY,
    load_factor: float = _LOAD,
    unverified: bool = _UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Write one self-contained HTML page, with the figures as PDF beside it."""
    from ..analysis import try_fit
    from ..analysis.compare.compare import write_comparison
    from ..analysis.report import write_report
    from ..analysis.report.figures import gmc_numbers

    _choice(model, ("rod", "solid"), "--model")
    loaded, left_out = _loaded(runs, unverified=unverified)
    path = out or (
        loaded[0].path / "report.html" if len(loaded) == 1 else Path("report.html")
    )
    _outputs(path, *(run.path / "comparison.csv" for run in loaded))
    done = _compared(
        loaded, left_out, model, clamp_angle_deg, gravity_m_s2, load_factor
    )
    fits = [None if no_fit else try_fit(run.run, run.support) for run in done]
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
        typer.echo(
            f"{comparison.run}, step {comparison.step.index}: {comparison.status}",
            err=True,
        )
    _tell_left_out(left_out, len(done))
    typer.echo(str(files.html))


def export(
    runs: list[Path] = _RUNS,
    out: Path = typer.Option(
        ...,
        "--out",
        help="NAME.mat, NAME.parquet, NAME.csv, or a folder for all three.",
    ),
    unverified: bool = _UNVERIFIED,
) -> None:
    """Export points, steps and comparisons as CSV, Parquet or MATLAB .mat."""
    from ..analysis.compare.export import check_export, export_runs

    loaded, left_out = _loaded(runs, unverified=unverified)
    check_export(out)
    done = _compared(loaded, left_out, "rod")
    for path in export_runs(done, out):
        typer.echo(str(path))
    _tell_left_out(left_out, len(done))


def paper(
    out: Path = typer.Option(Path("paper"), "--out", help="Folder for the runs."),
    seed: int = typer.Option(1, "--seed", help="Of the twin's hidden truth."),
    workers: int = typer.Option(
        2, "--workers", min=1, help="Benches that run side by side."
    ),
    json: bool = JSON,
) -> None:
    """Run the paper's seven GMCs at three fields on the twin bench, and report."""
    from ..analysis.paper.paper import reproduce

    with progress("paper") as tell:
        result = reproduce(out, seed=seed, workers=workers, progress=tell)
    if json:
        print_json(result.as_dict())
        return
    typer.echo(result.sentence())
    typer.echo(str(result.html))


def audit(
    out: Path = typer.Option(None, "--out", help="Also write the page as HTML."),
    json: bool = JSON,
) -> None:
    """Check the paper's own numbers; one verdict each, computed here."""
    from ..analysis.paper.audit import audit_paper, write_audit

    if out is not None:
        _outputs(out)
    findings = audit_paper()
    if out is not None:
        write_audit(out, findings)
    if json:
        print_json([finding.as_dict() for finding in findings])
        return
    for finding in findings:
        typer.echo(f"{finding.verdict.upper():12} {finding.claim}")
        typer.echo(f"{'':12} {finding.evidence}\n")


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
    from ..analysis.paper.probe import (
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
            typer.echo(
                f"remanence {remanence:.1f} mT at a stand-off of {standoff:.3f} mm"
            )
        return
    if json:
        print_json(found.as_dict())
        return
    for line in found.lines():
        typer.echo(line)


def _loaded(
    paths: Sequence[Path], *, unverified: bool
) -> tuple[list[RunData], list[str]]:
    """Return the runs that can be read, and a sentence on each that cannot."""
    from ..analysis.runs.load import load_runs

    loaded, left_out = load_runs(paths, unverified=unverified)
    for run in loaded:
        for warning in run.warnings:
            typer.echo(f"{run.label}: {warning}", err=True)
    return loaded, left_out


def _compared(
    loaded: Sequence[RunData],
    left_out: list[str],
    model: str,
    clamp_angle_deg: float = 0.0,
    gravity_m_s2: tuple[float, float, float] | None = None,
    load_factor: float = 1.0,
) -> list[RunComparison]:
    """Compare each run; add a sentence to `left_out` on each that cannot be."""
    from ..analysis.compare.compare import compare_run

    done, errors = [], []
    with progress("compare") if len(loaded) > 4 else nullcontext(silent) as tell:
        for number, run in enumerate(loaded, start=1):
            support = _support(run.support, clamp_angle_deg, gravity_m_s2, load_factor)
            try:
                done.append(compare_run(run, support=support, model=model))
            except MagbendError as error:
                errors.append(error)
                left_out.append(f"{run.path}: {error}")
            tell(number, len(loaded))
    if not done:
        raise errors[0]
    return done


def _tell_left_out(left_out: Sequence[str], kept: int) -> None:
    for sentence in left_out:
        typer.echo(f"left out: {sentence}", err=True)
    if left_out:
        runs = len(left_out) + kept
        typer.echo(f"{len(left_out)} of {runs} runs left out", err=True)


def _outputs(*paths: Path | None) -> None:
    """Refuse what cannot be written, before the work."""
    from ..core.files import output_file
    from ..core.owned import refuse_links
    from ..rig import is_run

    for path in paths:
        if path is not None:
            output_file(path)
            if is_run(path.parent):
                refuse_links(path.parent)


def _support(
    told: Support,
    clamp_angle_deg: float,
    gravity_m_s2: tuple[float, float, float] | None,
    load_factor: float,
) -> Support:
    """Return what was asked for; without a word on weight, that of the run."""
    from dataclasses import replace

    return replace(
        told,
        clamp_angle_deg=clamp_angle_deg,
        gravity_m_s2=gravity_m_s2 or told.gravity_m_s2,
        load_factor=load_factor,
    )


def _choice(value: str, allowed: Sequence[str], option: str) -> str:
    if value not in allowed:
        raise typer.BadParameter(
            f"must be {' or '.join(allowed)}; instead received {value!r}",
            param_hint=option,
        )
    return value


def _nuisance(hold: Sequence[str], prior: Sequence[str]) -> Any:
    """Return the priors with the named ones held or changed."""
    from dataclasses import replace

    from ..analysis import NUISANCE_NAMES, Nuisance

    values = dict.fromkeys(NUISANCE_NAMES if "all" in hold else hold, 0.0)
    for text in prior:
        name, _, number = text.partition("=")
        try:
            values[name] = float(number)
        except ValueError:
            raise typer.BadParameter(
                f"must be NAME=SD; instead received {text!r}", param_hint="--prior"
            ) from None
    unknown = [name for name in values if name not in NUISANCE_NAMES]
    if unknown:
        raise typer.BadParameter(
            f"must be one of {', '.join(NUISANCE_NAMES)}; "
            f"instead received {unknown[0]!r}",
            param_hint="--hold, --prior",
        )
    return replace(Nuisance(), **values)
