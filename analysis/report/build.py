"""Put a report together: numbers, figures and photographs into one HTML page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.derived import note_derived
from ...core.errors import MagbendError, StoreError
from ...core.files import write_bytes, write_text
from ...core.progress import Progress, silent
from ...sim import kinds_of
from ..compare.compare import IMPORTED, Comparison, RunComparison, models_of
from ..figures.fit import fit_figure
from ..figures.run import field_figure, residual_figure, shapes_figure, step_label
from ..figures.several import paper_figure, summary_figure
from ..figures.style import safe_name, to_pdf, to_svg
from ..fit.models import model_sentence
from ..fit.result import FitResult
from ..runs.data import Step
from .budget import BudgetLine, tip_budget
from .photos import photo_settings, photograph_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FULL_RUNS = 10
"""Up to this many runs each gets its own figures; beyond, the page is a summary with
photographs and tables, so that it stays light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """What a report consists of.

    Attributes
    ----------
    html : Path
        The page.
    figures : tuple of Path
        The same figures as PDF.
    """

    html: Path
    figures: tuple[Path, ...]


@dataclass(slots=True, kw_only=True)
class _Drawing:
    """Figures drawn so far: SVG goes into the page, PDF into the folder beside it."""

    folder: Path
    pdfs: dict[str, bytes]

    def add(self, name: str, figure: Figure | None) -> str:
        if figure is None:
            return ""
        svg = to_svg(figure, name)
        self.pdfs[f"{safe_name(name)}.pdf"] = to_pdf(figure)
        return svg


def write_report(
    runs: Sequence[RunComparison],
    out: Path,
    *,
    fits: Sequence[FitResult | str | None] | None = None,
    title: str = "",
    by_number: dict[int, RunComparison] | None = None,
    extra_html: Sequence[tuple[str, str]] = (),
    left_out: Sequence[str] = (),
    progress: Progress = silent,
) -> ReportFiles:
    """Write the report of one or several runs.

    Parameters
    ----------
    runs : sequence of RunComparison
        From `compare_run`; failed frames are shown as failed.
    out : Path
        The HTML file; PDFs go into ``figures/`` beside it.
    fits : sequence of FitResult, str or None, optional
        One a run; a sentence says why there is none, None leaves the section out.
    title : str
        Of the page; made up from the runs if empty.
    by_number : dict of int to RunComparison, optional
        The runs of GMC 1 to 7, for the paper's comparison figure.
    extra_html : sequence of (heading, html), optional
        Sections before the provenance; the HTML is taken as it is.
    left_out : sequence of str
        Runs that could not be read or compared, a sentence each.
    progress : callable
        Told after every run.

    Raises
    ------
    StoreError
        If there is no run.
    """
    if not runs:
        raise StoreError("a report needs at least one run; instead received none")
    drawing = _Drawing(folder=out.parent / "figures", pdfs={})
    fits = list(fits) if fits is not None else [None] * len(runs)
    photos = photo_settings(sum(len(run.run.steps) for run in runs))
    sections = []
    for index, (run, fit) in enumerate(zip(runs, fits, strict=True)):
        full = len(runs) <= FULL_RUNS
        prefix = "" if len(runs) == 1 else f"{run.run.label}-"
        sections.append(_section(run, fit, index, prefix, drawing, photos, full))
        progress(index + 1, len(runs))
    page = _render(
        title=title or _title(runs),
        runs=sections,
        summary=_summary(runs, drawing) if len(runs) > 1 else None,
        paper=_paper(by_number, drawing),
        extra=extra_html,
        origins=_origins(runs),
        has_imported=all(run.of(IMPORTED) for run in runs),
        left_out=left_out,
        made_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        version=_version(),
    )
    drawing.folder.mkdir(parents=True, exist_ok=True)
    for name, data in drawing.pdfs.items():
        write_bytes(drawing.folder / name, data)
    write_text(out, page)
    pdfs = tuple(drawing.folder / name for name in drawing.pdfs)
    used = [file for run in runs for file in run.run.files]
    note_derived([out, *pdfs], sources=used, command="analysis report")
    return ReportFiles(html=out, figures=pdfs)


def _origins(runs: Sequence[RunComparison]) -> list[str]:
    """Return what a reader must know first: which runs are no experiment here."""
    twins = sum(bool(run.run.record.get("twin")) for run in runs)
    imported = sum(bool(run.run.record.get("imported")) for run in runs)
    sentences = []
    if twins:
        what = "This run" if len(runs) == 1 else f"{twins} of {len(runs)} runs"
        sentences.append(f"{what}: a simulated bench (twin), no experiment.")
    if imported:
        what = "This run" if len(runs) == 1 else f"{imported} of {len(runs)} runs"
        sentences.append(f"{what}: imported from a table, not recorded by this bench.")
    return sentences


def _title(runs: Sequence[RunComparison]) -> str:
    return runs[0].run.name if len(runs) == 1 else f"{len(runs)} bending runs"


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("magbend")
    except PackageNotFoundError:
        return "unknown"


def _render(**context: Any) -> str:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    environment.filters["markup"] = Markup
    return environment.get_template("report.html").render(**context)


def number(value: Any, digits: int = 3) -> str:
    """Return a number as text: a dash where there is none, never ``nan``."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, float) and math.isinf(value):
        return "∞"
    # Adding zero turns the -0.0 of a rounded small number into 0.0.
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _section(
    run: RunComparison,
    fit: FitResult | str | None,
    index: int,
    prefix: str,
    drawing: _Drawing,
    photos: dict[str, Any],
    full: bool,
) -> dict[str, Any]:
    """Everything the page says about one run."""
    steps = [_step(run, step, photos) for step in run.run.steps]
    draw: Callable[[str, Callable[[], Figure | None]], str] = (
        (lambda name, make: drawing.add(f"{prefix}{name}", make()))
        if full
        else (lambda _name, _make: "")
    )
    compared = any(c.ok for c in run.comparisons)
    fitted = fit if isinstance(fit, FitResult) else None
    return {
        "id": f"run-{index}",
        "label": run.run.label,
        "data": run.run,
        "specimen": specimen_sentence(run),
        "has_imported": "imported" in run.models,
        "headline": _headline(run),
        "failures": [c for c in run.of("magnet") if not c.ok],
        "warnings": run.run.warnings,
        "steps": steps,
        "shapes": draw("shapes", lambda: shapes_figure(run)),
        "residuals": draw(
            "residuals", lambda: residual_figure(run) if compared else None
        ),
        "field": draw("field", lambda: field_figure(run)),
        "magnet_fit": run.magnet_fit,
        "magnet": run.magnet,
        "sources": run.sources,
        "fit": _fit_context(fitted),
        "no_fit": fit if isinstance(fit, str) else "",
        "fit_figure": draw(
            "fit", lambda: fit_figure(fitted) if fitted is not None else None
        ),
        "budget": _budget(run, fitted) if full else [],
        "provenance": _provenance(run),
        "full": full,
    }


def _step(run: RunComparison, step: Step, photos: dict[str, Any]) -> dict[str, Any]:
    """One step: its photograph, its comparisons, its doubts."""
    comparisons = [c for c in run.comparisons if c.step is step]
    return {
        "comparisons": [step_row(c) for c in comparisons],
        "photo": photograph_svg(run, comparisons, **photos),
        "failed": not any(c.ok for c in comparisons),
        "status": comparisons[0].status,
        "label": step_label(comparisons[0]),
        "step": step,
        "flags": comparisons[0].flags,
    }


def step_row(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison's row with the names the template uses."""
    row = comparison.row()
    row["ok"] = comparison.ok
    row["flag_list"] = comparison.flags
    return row


def specimen_sentence(run: RunComparison) -> str:
    """Return what the nominal rod is, in one line."""
    specimen = run.run.specimen
    lengths = "-".join(f"{section.length_mm:g}" for section in specimen.sections)
    moduli = "-".join(f"{section.E_MPa:g}" for section in specimen.sections)
    return (
        f"{specimen.name}: {lengths} mm of {moduli} MPa (root first), "
        f"side {specimen.side_mm:g} mm, remanence {specimen.remanence_mT:g} mT"
    )


def _headline(run: RunComparison) -> list[dict[str, str]]:
    """Return the few numbers that matter, of the steps that could be compared."""
    cards = []
    for model in run.models:
        done = [c.errors for c in run.of(model) if c.errors]
        if not done:
            continue
        worst = max(done, key=lambda errors: errors.tip_mm)
        cards += [
            {
                "name": f"RMS distance, {model}",
                "value": f"{np.median([e.rms_mm for e in done]):.3f} mm",
                "note": f"median of {len(done)} step{'s' * (len(done) > 1)}",
            },
            {
                "name": f"worst tip distance, {model}",
                "value": f"{worst.tip_mm:.3f} mm",
                "note": f"{worst.tip_percent:.2f} % of the length",
            },
        ]
    return cards


def _fit_context(fit: FitResult | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    again = (*fit.E_sd_statistical_MPa, *[math.nan] * len(fit.parameters))
    rows = [
        {
            "name": name,
            "value": value,
            "sd": sd,
            "percent": 100.0 * sd / value if value else math.nan,
            "known": name not in fit.not_identifiable,
            "again": alone,
        }
        for name, value, sd, alone in zip(
            fit.parameters, fit.values, fit.sd, again, strict=False
        )
    ]
    shares = [
        f"{kind} {100.0 * float(max(share[: len(fit.E_MPa)])):.1f} %"
        for kind, share in list(fit.budget.items())[:5]
    ]
    verdict = fit.verdict
    pulls = verdict.pulls.items() if verdict else ()
    return {
        "result": fit,
        "rows": rows,
        "correlation": fit.correlation.tolist(),
        "budget": ", ".join(shares) or "none, all are held",
        "verdict": verdict,
        "p_value": f"{verdict.p_value:.2g}" if verdict else "",
        "pulls": ", ".join(f"{of} {pull:+.1f}" for of, pull in pulls if abs(pull) > 2),
        "models": model_sentence(verdict.models) if verdict else "",
    }


def _budget(run: RunComparison, fit: FitResult | None) -> list[dict[str, Any]]:
    try:
        lines: Sequence[BudgetLine] = tip_budget(run, fit=fit)
    except MagbendError:
        # A case the sensitivities refuse has no budget; the comparison stands.
        return []
    top = max((line.tip_um for line in lines), default=1.0) or 1.0
    return [{"line": line, "share": 100.0 * line.tip_um / top} for line in lines]


def _provenance(run: RunComparison) -> list[tuple[str, str]]:
    """Where every number comes from, as pairs for a table."""
    record = run.run.record
    pairs = [
        ("run folder", str(run.run.path)),
        ("id", str(record.get("id", ""))),
        ("created (UTC)", str(record.get("created_utc", ""))),
        ("operator, host", f"{record.get('operator', '')}, {record.get('host', '')}"),
        ("bench", _bench(record)),
        ("ended", str(run.run.end.get("status", "cut off, no end.json"))),
        ("versions when recorded", _pairs(record.get("versions"))),
        ("devices", _pairs(record.get("devices"))),
        ("measured lines", "centrelines.csv, frames.csv"),
        ("flux density", "steps.jsonl, as read by the Tesla-meter"),
        ("simulated, uniform", "flux read at the undeformed tip, everywhere"),
        ("simulated, magnet", _magnet_sentence(run)),
        ("clamp, weight, load", _support_sentence(run)),
    ]
    calibration = run.run.calibration
    if calibration is not None:
        pairs.append(
            (
                "calibration",
                f"calibration.json: {calibration.board or 'board not named'}, "
                f"RMS {calibration.rms_px:.2f} px",
            )
        )
    return [(name, text) for name, text in pairs if text.strip(", ")]


def _bench(record: dict[str, Any]) -> str:
    table = record.get("imported")
    if table:
        return f"imported from {table['table']} (SHA-256 {table['sha256'][:16]}...)"
    return "twin (simulated devices)" if record.get("twin") else "real devices"


def _pairs(data: Any) -> str:
    if not isinstance(data, dict):
        return str(data or "")
    return ", ".join(
        f"{key} {value}" for key, value in data.items() if not isinstance(value, dict)
    )


def _magnet_sentence(run: RunComparison) -> str:
    if run.sources is not None:
        return f"{kinds_of(run.sources)}, as in the source file that was given"
    if run.magnet is None:
        return "the rig file describes no magnet"
    sides = " x ".join(f"{side:g}" for side in run.magnet.sides_mm)
    source = "fitted to the readings" if run.magnet_fit else "as in the rig file"
    return (
        f"cuboid {sides} mm, remanence {run.magnet.remanence_T:.4f} T {source}, "
        f"axis {run.magnet.axis_angle_deg:g} deg"
    )


def _support_sentence(run: RunComparison) -> str:
    support = run.support
    weight = (
        f"gravity {support.gravity_m_s2} m/s2"
        if any(support.gravity_m_s2)
        else "weight left out"
    )
    return (
        f"clamp at {support.clamp_angle_deg:g} deg, {weight}, "
        f"load factor {support.load_factor:g}"
    )


def _summary(runs: Sequence[RunComparison], drawing: _Drawing) -> dict[str, Any]:
    rows = [
        {**step_row(c), "anchor": f"run-{index}"}
        for index, run in enumerate(runs)
        for c in run.comparisons
    ]
    return {
        "rows": rows,
        "counts": {
            "runs": len(runs),
            "steps": sum(len(run.run.steps) for run in runs),
            "failed": sum(not c.ok for run in runs for c in run.of("magnet")),
        },
        "models": [_model_summary(runs, model) for model in models_of(runs)],
        "figure": drawing.add("summary", summary_figure(runs)),
    }


def _model_summary(runs: Sequence[RunComparison], model: str) -> dict[str, Any]:
    done = [c.errors for run in runs for c in run.of(model) if c.errors]
    if not done:
        return {"model": model, "count": 0}
    return {
        "model": model,
        "count": len(done),
        "rms_mm": float(np.median([e.rms_mm for e in done])),
        "worst_mm": max(e.max_mm for e in done),
        "tip_mm": float(np.median([e.tip_mm for e in done])),
        "tip_percent": float(np.median([e.tip_percent for e in done])),
    }


def _paper(by_number: dict[int, RunComparison] | None, drawing: _Drawing) -> str:
    if not by_number:
        return ""
    return drawing.add("comparison", paper_figure(by_number))
