"""``magbend analysis fit`` and ``next``: moduli, how sure they are, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from ..core.errors import InputError
from .analysis_show import print_fit, print_proposals
from .console import JSON, print_json, progress
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


def register(app: typer.Typer) -> None:
    """Add the commands to the group."""
    app.command(epilog="Example: magbend analysis fit runs/gmc2 --json")(fit)
    app.command("next", epilog="Example: magbend analysis next runs/gmc2")(next_)


def fit(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(
        None, "--out", help="fit.json; in the first run folder if not given."
    ),
    field: str = typer.Option("magnet", "--field", help="magnet or uniform."),
    magnet: Path = MAGNET,
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
    seed: int = typer.Option(0, "--seed", min=0, help="Of the posterior's walkers."),
    clamp_angle_deg: float = CLAMP,
    gravity_m_s2: tuple[float, float, float] = GRAVITY,
    load_factor: float = LOAD,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Fit the moduli with uncertainties; write fit.json."""
    from ..analysis import (
        check_installed,
        common_support,
        fit_runs,
        from_probe_reading,
        sample_posterior,
        write_fit,
    )
    from ..core.derived import note_derived
    from ..sim import Support, read_field

    choice(field, ("magnet", "uniform"), "--field")
    choice(model, ("rod", "solid"), "--model")
    if (field, model) == ("uniform", "solid"):
        raise InputError("--model solid needs the magnet's field; leave --field out")
    nuisance = _nuisance(hold, prior)
    if posterior:
        check_installed()
    sources = read_field(magnet) if magnet is not None else None
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    path = out or loaded[0].path / "fit.json"
    outputs(path)
    if probe_standoff_mm is not None:
        loaded = [from_probe_reading(run, probe_standoff_mm) for run in loaded]
    told = Support() if gravity_m_s2 else common_support(loaded)
    result = fit_runs(
        loaded,
        model="solid" if model == "solid" else field,
        free=free,
        nuisance=nuisance,
        support=support_of(told, clamp_angle_deg, gravity_m_s2, load_factor),
        prior_MPa=range_MPa,
        bounds_MPa=bounds_MPa,
        falling=falling,
        sources=sources,
    )
    sampled = None
    if posterior:
        with progress("posterior") as tell:
            sampled = sample_posterior(
                result, steps=posterior, seed=seed, progress=tell
            )
    write_fit(path, result, sampled)
    used = [file for run in loaded for file in run.files]
    if magnet is not None:
        used.append(magnet)
    note_derived([path], sources=used, command="analysis fit")
    data = result.as_dict()
    if sampled is not None:
        data["posterior"] = sampled.as_dict()
    if json:
        print_json(data)
    else:
        print_fit(result, path, data.get("posterior"))
    tell_left_out(left_out, len(loaded))


def next_(
    runs: list[Path] = RUNS,
    minutes: float = typer.Option(
        None, "--minutes", help="Leave out what takes longer."
    ),
    gravity_m_s2: tuple[float, float, float] = GRAVITY,
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Say which experiment would shorten the intervals of the moduli most."""
    from ..analysis import common_support, fit_runs, limits_of_knowledge, proposals
    from ..sim import Support

    if minutes is not None and not minutes > 0.0:
        raise InputError(f"--minutes must be above zero; instead received {minutes:g}")
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    told = Support() if gravity_m_s2 else common_support(loaded)
    result = fit_runs(
        loaded, support=support_of(told, 0.0, gravity_m_s2, 1.0), judged=False
    )
    found = proposals(result, loaded, minutes=minutes)
    if json:
        print_json([one.as_dict() for one in found])
    else:
        print_proposals(result, found, limits_of_knowledge(result))
    tell_left_out(left_out, len(loaded))


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
