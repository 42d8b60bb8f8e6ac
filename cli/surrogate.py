"""``magbend analysis surrogate`` and ``sensitivity``."""

from __future__ import annotations

from pathlib import Path

import typer

from .analysis_import import ALIGN, FLIP, UNIT
from .console import JSON, group, print_json, progress, say

app = group(
    "surrogate",
    "Predict whole shapes without solving; fit to the solver or to imported tables.",
    "magbend analysis surrogate predict --gmc 2 --field-mT 50 --out shape.csv",
)
SENSITIVITY_EXAMPLE = "Example: magbend analysis sensitivity --figure sobol.svg"


@app.command(
    epilog="Example: magbend analysis surrogate predict --gmc 2 --field-mT 50 --json"
)
def predict(
    flux_mT: float = typer.Option(..., "--field-mT", help="Uniform field at 90 deg."),
    gmc: int | None = typer.Option(None, "--gmc", min=1, max=7, help="Of Table 1."),
    specimen: Path | None = typer.Option(None, "--specimen", help="Specimen file."),
    model: Path | None = typer.Option(
        None, "--model", help="A model of `surrogate fit`; default: the packaged one."
    ),
    correction: Path | None = typer.Option(
        None, "--correction", help="A file of `surrogate correct`."
    ),
    out: Path | None = typer.Option(None, "--out", help="Write the shape (CSV)."),
    as_json: bool = JSON,
) -> None:
    """Predict a shape with its error bar; refuse outside the trust region."""
    from ..analysis.surrogate import model as surrogate
    from ..analysis.surrogate import tables as surrogate_tables
    from ..core.centreline import Centreline
    from ..core.errors import InputError
    from ..core.files import output_file
    from ..core.specimen_file import read_specimen
    from ..sim import designs_of
    from ..sim import gmc as table_1

    if (gmc is None) == (specimen is None):
        raise InputError("give either --gmc or --specimen")
    if specimen is not None:
        rod = read_specimen(specimen)
    else:
        rod = table_1(gmc or 1)
    if out is not None:
        output_file(out)
    designs = designs_of(rod, flux_mT)
    if correction is not None:
        learnt = surrogate_tables.load_correction(correction)
        points, inside = surrogate_tables.corrected(learnt, designs)
        error_mm = learnt.error_mm
    else:
        found = surrogate.predict(surrogate.load(model), designs)
        points, inside, error_mm = found.points, found.inside, found.error_mm[0]
    if not inside[0]:
        raise InputError(
            "this rod and field are outside the surrogate's trust region; solve it "
            "directly with `magbend sim shape`"
        )
    line = Centreline(**dict(zip(_COLUMNS, points[0].T, strict=True)))
    if out is not None:
        line.to_csv(out)
    answer = {
        "tip_mm": line.tip_mm,
        "tip_angle_deg": line.tip_angle_deg,
        "error_mm": float(error_mm),
    }
    if as_json:
        print_json(answer)
        return
    x, y = line.tip_mm
    say(f"tip ({x:.5f}, {y:.5f}) mm, {line.tip_angle_deg:.4f} deg")
    bound = "no left-out case was" if correction else "in 95 % no point is"
    say(f"{bound} off by more than {error_mm:.2g} mm")


_COLUMNS = ("s_mm", "x_mm", "y_mm", "theta_rad", "kappa_per_mm")


@app.command(epilog="Example: magbend analysis surrogate fit --out surrogate.npz")
def fit(
    out: Path = typer.Option(..., "--out", help="Model file (.npz)."),
    degree: int | None = typer.Option(None, "--degree", help="Of the polynomial."),
    as_json: bool = typer.Option(False, "--json", help="Print the model card."),
) -> None:
    """Fit the surrogate to solved shapes over its domain."""
    from ..analysis.surrogate import fit as surrogate_fit
    from ..analysis.surrogate import model as surrogate
    from ..core.files import output_file

    output_file(out)
    with progress("fitting") as tell:
        model = surrogate_fit.fit(degree=degree or surrogate_fit.DEGREE, progress=tell)
    surrogate.save(model, out)
    if as_json:
        print_json(model.card)
        return
    card = model.card
    say(
        f"on unseen designs: {card['rms_mm']:.2g} mm RMS, worst tip "
        f"{card['worst_tip_mm']:.2g} mm"
    )


@app.command(
    epilog="Example: magbend analysis surrogate correct comsol_*.txt --out fem.json"
)
def correct(
    tables: list[Path] = typer.Argument(
        ..., help="Files of shapes: COMSOL or other text, CSV, MATLAB, Mathematica."
    ),
    out: Path = typer.Option(..., "--out", help="Correction file (.json)."),
    specimen: Path = typer.Option(
        None, "--specimen", help="The rod, where the files do not describe it."
    ),
    flux: str = typer.Option(
        "", "--flux", help="Which parameter is the flux density, and its unit: B0=T."
    ),
    unit: str = UNIT,
    flip: bool = FLIP,
    align: bool = ALIGN,
    as_json: bool = JSON,
) -> None:
    """Learn from finite-element or COMSOL tables what the rod misses."""
    from ..analysis import Reading
    from ..analysis.surrogate import tables as surrogate_tables
    from ..core.files import output_file
    from ..core.specimen_file import read_specimen

    cases = surrogate_tables.read_tables(
        tables,
        how=Reading(unit=unit, flip=flip, align=align),
        specimen=read_specimen(specimen) if specimen else None,
        flux=flux,
    )
    output_file(out)
    learnt = surrogate_tables.fit_correction(cases)
    surrogate_tables.save_correction(learnt, out)
    if as_json:
        print_json(
            {
                "cases": learnt.cases,
                "error_mm": learnt.error_mm,
                "rod_error_mm": learnt.rod_error_mm,
                "degree": learnt.degree,
            }
        )
        return
    say(
        f"{learnt.cases} cases: the rod alone is off by up to "
        f"{learnt.rod_error_mm:.2g} mm, corrected (each case left out in turn) by up "
        f"to {learnt.error_mm:.2g} mm"
    )


@app.command(epilog="Example: magbend analysis surrogate compare")
def compare(
    designs: int = typer.Option(2000, "--designs", min=64, help="Unseen designs."),
    as_json: bool = JSON,
) -> None:
    """Print one honest table: solver, network, linear formula, surrogate."""
    from dataclasses import asdict

    from ..analysis.surrogate import compare as surrogate_compare
    from ..analysis.surrogate import model as surrogate

    rows = surrogate_compare.compare(surrogate.load(), designs=designs)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    say(f"{'':22s}  RMS mm      worst tip mm  time us   size kB")
    for row in rows:
        cells = (row.rms_mm, row.worst_tip_mm, row.time_us, row.size_kB)
        text = "  ".join(f"{'-' if v != v else format(v, '.2g'):>10s}" for v in cells)
        say(f"{row.name:22s}{text}")


def sensitivity(
    fields_mT: list[float] = typer.Option(
        [10.0, 60.0, 120.0], "--field-mT", help="Uniform field, mT; repeatable."
    ),
    samples: int = typer.Option(2048, "--samples", help="Base samples, power of two."),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed."),
    figure: Path | None = typer.Option(
        None, "--figure", help="Draw the indices (.svg, .pdf, .png)."
    ),
    out: Path | None = typer.Option(None, "--out", help="Write the table (CSV)."),
    as_json: bool = JSON,
) -> None:
    """Say which parameter matters where: Sobol indices over the design domain."""
    from ..analysis.surrogate import figures as model_figures
    from ..analysis.surrogate import sobol
    from ..core.files import output_file, write_text

    if figure is not None:
        model_figures.check_path(figure)
    if out is not None:
        output_file(out)
    with progress("fields") as tell:
        found = sobol.sensitivity(
            fields_mT=fields_mT, samples=samples, seed=seed, progress=tell
        )
    rows = found.rows()
    if figure is not None:
        model_figures.save_figure(model_figures.sobol_figure(found), figure)
    if out is not None:
        lines = [",".join(rows[0])]
        lines += [",".join(str(value) for value in row.values()) for row in rows]
        write_text(out, "\n".join(lines) + "\n")
    if as_json:
        print_json(rows)
        return
    for i, flux in enumerate(found.fields_mT):
        say(f"{flux:g} mT, total order (share of the variance):")
        say(" " * 17 + "".join(f"{name:>15s}" for name in sobol.OUTPUTS))
        for k, parameter in enumerate(sobol.PARAMETERS):
            cells = "".join(f"{value:15.3f}" for value in found.total[i, :, k])
            say(f"{parameter:17s}{cells}")
