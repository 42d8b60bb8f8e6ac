"""``magbend analysis recipe``: from mixing ratios to modulus and remanence."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .console import JSON, group, print_json, say
from .run_options import RUNS, UNVERIFIED, loaded_runs, outputs, tell_left_out

if TYPE_CHECKING:
    from ..analysis import Law

app = group(
    "recipe",
    "From mixing ratios to modulus and remanence.",
    "magbend analysis recipe predict --pcl 3:1 --ndfeb 175",
)
_LAW = Path("recipe.json")


@app.command(epilog="Example: magbend analysis recipe fit runs/* --out recipe.json")
def fit(
    runs: list[Path] = RUNS,
    out: Path = typer.Option(_LAW, "--out", help="Where the law is kept."),
    unverified: bool = UNVERIFIED,
    json: bool = JSON,
) -> None:
    """Fit a law of mixing to the rods of the runs, whose files have a [recipe]."""
    from ..analysis import fit_law, fit_rods, write_law

    outputs(out)
    loaded, left_out = loaded_runs(runs, unverified=unverified)
    rods = fit_rods(loaded)
    law = fit_law(rods)
    write_law(out, law)
    if json:
        print_json(_as_dict(law))
    else:
        _print(law)
        say(str(out))
    tell_left_out(left_out, len(loaded))


@app.command(epilog="Example: magbend analysis recipe predict --pcl 3:1 --ndfeb 175")
def predict(
    pcl: str = typer.Option(..., "--pcl", help="Soft to rigid PCL by weight: 3:1."),
    ndfeb: float = typer.Option(
        ..., "--ndfeb", help="NdFeB in percent of the weight of PCL."
    ),
    law: Path = typer.Option(_LAW, "--law", help="From recipe fit."),
    json: bool = JSON,
) -> None:
    """Say what a new rod of a mixture will be, with 95 % intervals."""
    from ..analysis import Mixture, predict_mixture, read_law, read_ratio

    mixture = Mixture(soft_per_rigid=read_ratio(pcl), ndfeb_percent=ndfeb)
    found = predict_mixture(read_law(law), mixture)
    if json:
        print_json(found.as_dict())
        return
    low, high = found.E_interval_MPa
    say(f"E          {found.E_MPa:.3g} MPa (95 %: {low:.3g} to {high:.3g})")
    low, high = found.remanence_interval_mT
    say(f"remanence  {found.remanence_mT:.3g} mT (95 %: {low:.3g} to {high:.3g})")
    say(f"density    {found.density_kg_m3:.0f} kg/m3 without voids")
    if not found.inside:
        say(
            "this mixture lies outside those that were fitted: the law is stretched",
            err=True,
        )


def _as_dict(law: Law) -> dict[str, object]:
    from dataclasses import asdict

    return asdict(law)


def _print(law: Law) -> None:
    say(f"{len(law.rods)} rods: {', '.join(law.rods)}")
    for name, value in (
        ("moduli, rod to rod", law.rod_scatter),
        ("moduli, section to section", law.section_scatter),
        ("remanence, rod to rod", law.remanence_scatter),
    ):
        say(f"  scatter of {name}: {100.0 * value:.1f} %")
