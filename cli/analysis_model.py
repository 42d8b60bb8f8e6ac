"""``magbend analysis train | predict``: the expansion model."""

from __future__ import annotations

from pathlib import Path

import typer

from . import design, library, surrogate
from .console import JSON, print_json, progress, say


def train(
    seeds: int = typer.Option(10, "--seeds", help="How many seeds, from 0 on."),
    steps: int | None = typer.Option(
        None, "--steps", help="Optimiser steps of each training (default 3000)."
    ),
    out: Path | None = typer.Option(
        None, "--out", help="Write the model trained on all cases here (.npz)."
    ),
    figure: Path | None = typer.Option(
        None, "--figure", help="Plot every seed of every split (.svg, .pdf, .png)."
    ),
    as_json: bool = JSON,
) -> None:
    """Train the paper's expansion model, and say honestly how far it reaches."""
    from ..analysis.expansion import model as expansion
    from ..analysis.expansion import train as expansion_train
    from ..analysis.surrogate import figures as model_figures
    from ..core.files import output_file

    if figure is not None:
        model_figures.check_path(figure)
    if out is not None:
        output_file(out)
    with progress("training") as tell:
        report = expansion_train.train(
            seeds=seeds,
            steps=expansion_train.STEPS if steps is None else steps,
            progress=tell,
        )
    published = expansion_train.PUBLISHED_MSE_PER_MM2
    if out is not None:
        expansion.save(report.model, out)
    if figure is not None:
        drawing = model_figures.training_figure(report, published)
        model_figures.save_figure(drawing, figure)
    if as_json:
        print_json(report.as_dict())
        return
    say("test mean squared error of a (1/mm2), one row a seed:")
    say("seed  random field   top field      one whole GMC")
    columns = report.test_mse_per_mm2
    for seed in range(seeds):
        row = "   ".join(f"{columns[split][seed]:12.3e}" for split in columns)
        say(f"{seed:4d}  {row}")
    for name, pick in (("median", 0.5), ("worst", 1.0)):
        row = "   ".join(f"{_quantile(columns[s], pick):12.3e}" for s in columns)
        say(f"{name:>6s}{row}")
    say(f"the paper reports {published:g} on the first of the three splits")


TRAIN_EXAMPLE = "Example: magbend analysis train --seeds 10 --figure mse.svg"


def _quantile(values: object, share: float) -> float:
    import numpy as np

    return float(np.quantile(np.asarray(values), share))


def predict(
    flux_mT: float = typer.Option(..., "--field-mT", help="Flux density, mT."),
    gmc: int | None = typer.Option(
        None, "--gmc", min=1, max=7, help="A rod of Table 1, sides as remeasured."
    ),
    E_MPa: tuple[float, float, float] | None = typer.Option(
        None, "--E-MPa", help="Three moduli, root first, MPa."
    ),
    lengths_mm: tuple[float, float, float] | None = typer.Option(
        None, "--lengths-mm", help="Three unit lengths, root first, mm."
    ),
    side_mm: float | None = typer.Option(None, "--side-mm", help="Side, mm."),
    model: Path | None = typer.Option(
        None, "--model", help="A model of `train --out`; default: the packaged one."
    ),
    as_json: bool = JSON,
) -> None:
    """Predict a of y = a x^2 with the trained network; warn outside its domain."""
    from ..analysis.expansion import model as expansion
    from ..core.errors import InputError

    if gmc is not None and (E_MPa or lengths_mm or side_mm):
        raise InputError("give either --gmc or --E-MPa, --lengths-mm and --side-mm")
    if gmc is not None:
        from ..analysis import inputs_of
        from ..sim import gmc as rod

        inputs = inputs_of(rod(gmc, remeasured=True), flux_mT)
    elif E_MPa and lengths_mm and side_mm is not None:
        inputs = [flux_mT, *E_MPa, *lengths_mm, side_mm]
    else:
        raise InputError("give either --gmc or --E-MPa, --lengths-mm and --side-mm")
    trained = expansion.load(model)
    a_per_mm = float(expansion.predict(trained, inputs)[0])
    warnings = expansion.outside(trained, inputs)
    errors = trained.card["errors"]
    if as_json:
        print_json(
            {
                "a_per_mm": a_per_mm,
                "inputs": dict(zip(expansion.INPUTS, inputs, strict=True)),
                "inside_domain": not warnings,
                "warnings": warnings,
                "errors": errors,
            }
        )
        return
    say(f"y = a x^2 with a = {a_per_mm:.6g} 1/mm")
    error = errors["specimen" if warnings else "field"]["median_test_mse_per_mm2"]
    say(f"typical error of a: {error**0.5:.2g} 1/mm")
    for warning in warnings:
        say(f"warning: {warning}", err=True)


PREDICT_EXAMPLE = "Example: magbend analysis predict --gmc 2 --field-mT 50"


def register(app: typer.Typer) -> None:
    """Add the commands to ``magbend analysis``."""
    app.command("train", epilog=TRAIN_EXAMPLE)(train)
    app.command("predict", epilog=PREDICT_EXAMPLE)(predict)
    app.command("design", epilog=design.EXAMPLE)(design.design)
    app.command("sensitivity", epilog=surrogate.SENSITIVITY_EXAMPLE)(
        surrogate.sensitivity
    )
    app.add_typer(surrogate.app, name="surrogate")
    app.add_typer(library.app, name="library")
