"""What ``magbend analysis compare`` and ``fit`` print."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.text import printable
from .console import say

if TYPE_CHECKING:
    import pandas as pd

    from ..analysis import FitResult, Proposal


def print_comparison(table: pd.DataFrame) -> None:
    """Print a row for each step."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    shown = (
        ("run", "run", None), ("step", "step", "d"), ("gap mm", "gap_mm", ".1f"),
        ("flux mT", "flux_mT", ".2f"), ("model", "model", None),
        ("moduli", "moduli", None),
        ("RMS mm", "rms_mm", ".3f"), ("max mm", "max_mm", ".3f"),
        ("tip mm", "tip_mm", ".3f"), ("tip %", "tip_percent", ".2f"),
        ("angle deg", "tip_angle_deg", ".2f"), ("R meas", "radius_measured_mm", ".1f"),
        ("R sim", "radius_simulated_mm", ".1f"), ("status", "status", None),
    )  # fmt: skip
    view = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for title, _, form in shown:
        view.add_column(title, justify="right" if form else "left", overflow="fold")
    for row in table.to_dict("records"):
        view.add_row(*(_cell(row[name], form) for _, name, form in shown))
    console = Console()
    if not console.is_terminal:
        # A pipe has no width of its own: every row stays on one line.
        console = Console(width=240)
    console.print(view)


def _cell(value: Any, form: str | None) -> str:
    if form is None:
        return printable(str(value))
    return "-" if isinstance(value, float) and math.isnan(value) else f"{value:{form}}"


def print_fit(result: FitResult, path: Path, posterior: dict[str, Any] | None) -> None:
    """Print what was fitted, how sure it is, and where it was written."""
    say(
        f"{result.specimen.name}: {result.steps} steps, model {result.model}, "
        f"{result.rms_um:.2g} µm RMS left, reduced chi2 {result.chi2_reduced:.2f}, "
        f"condition number {result.condition_number:.3g}"
    )
    again = (*result.E_sd_statistical_MPa, *[math.nan] * len(result.parameters))
    for name, value, sd, alone in zip(
        result.parameters, result.values, result.sd, again, strict=False
    ):
        if name in result.not_identifiable:
            say(f"  {name:20} not identifiable")
        else:
            noise = f"; +- {alone:.2g} statistical" if math.isfinite(alone) else ""
            say(
                f"  {name:20} {value:.4g} +- {sd:.2g} ({100 * sd / value:.1f} %{noise})"
            )
    _print_budget(result)
    _print_verdict(result)
    for k, name in enumerate(result.parameters):
        for m in range(k):
            value = result.correlation[k, m]
            if abs(value) > 0.5:
                say(f"  correlation of {result.parameters[m]}, {name}: {value:.2f}")
    for sentence in result.directions:
        say(f"not identifiable: {sentence}")
    for name, (value, sd) in result.ratios.items():
        say(f"  {name} = {value:.4g} +- {sd:.2g} is what the data tell")
    for sentence in result.skipped:
        say(f"left out: {sentence}", err=True)
    if posterior and posterior["doubt"]:
        say(f"posterior: {posterior['doubt']}", err=True)
    if posterior:
        for name, low, middle, high in zip(
            posterior["parameters"],
            *(posterior[key] for key in ("q2_5", "median", "q97_5")),
            strict=True,
        ):
            say(f"  posterior {name}: {middle:.4g} (95 %: {low:.4g} to {high:.4g})")
    say(str(path))


def _print_budget(result: FitResult) -> None:
    """Say which nuisances the standard deviations are made of."""
    count = len(result.E_MPa)
    shares = [
        f"{kind} {100.0 * max(share[:count]):.2g} %"
        for kind, share in result.budget.items()
        if max(share[:count]) > 0.001
    ]
    if shares:
        say(f"  of the moduli's sd: {', '.join(shares[:6])}")


def _print_verdict(result: FitResult) -> None:
    """Say whether the model can be believed, and what would explain its misfit."""
    from ..analysis import model_sentence

    verdict = result.verdict
    if verdict is None:
        return
    say(f"verdict: {verdict.verdict} (p = {verdict.p_value:.2g})")
    for sentence in verdict.reasons:
        say(f"  {sentence}")
    if verdict.rests_on:
        say(f"  {verdict.told_sentence()}")
    title = "would explain it" if verdict.reasons else "no more than chance"
    for suspect in verdict.suspects[:3]:
        say(f"  {title}: {suspect.sentence()}")
    pulls = verdict.pulls.items()
    strong = [f"{of} {pull:+.1f}" for of, pull in pulls if abs(pull) > 2.0]
    if strong:
        say(f"  pulled by more than 2 sd: {', '.join(strong)}")
    sentence = model_sentence(verdict.models)
    if sentence:
        say(f"  {sentence}")


def print_proposals(
    result: FitResult, found: Sequence[Proposal], limits: Sequence[str]
) -> None:
    """Print what could be done next, and what no photograph can tell."""
    now = [sd / value for value, sd in zip(result.E_MPa, result.E_sd_MPa, strict=True)]
    known = [100.0 * share for share in now if math.isfinite(share)]
    if known:
        say(f"{result.specimen.name}: the worst modulus is known to {max(known):.2g} %")
    if not found:
        say("nothing useful is done in that time: give --minutes more")
    else:
        say("sd, %  minutes  change")
    for one in found:
        say(f"{one.predicted_sd_percent:5.2f}  {one.minutes:7.0f}  {one.change}")
    for sentence in limits:
        say(sentence)
