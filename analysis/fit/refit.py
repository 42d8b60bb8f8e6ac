"""Compare theories like with like: each with the moduli that it finds itself."""

from __future__ import annotations

from dataclasses import replace

from ...core.errors import MagbendError
from ..compare.compare import MODELS, RunComparison, compare_run
from .runs import fit_runs

FIT_AS = {("uniform", "rod"): "uniform", ("magnet", "rod"): "magnet",
          ("magnet", "solid"): "solid"}  # fmt: skip
"""The fitted model of a field and a theory of the rod."""


def with_refitted(done: RunComparison, *, theory: str = "rod") -> RunComparison:
    """Return the comparisons, and after them those with refitted moduli.

    With nominal moduli the theory whose error happens to match that of the moduli looks
    better. A theory that cannot be fitted keeps its status, which says why.

    Parameters
    ----------
    done : RunComparison
        With nominal moduli.
    theory : {"rod", "solid"}
        Rod theory of the comparisons.
    """
    more = []
    for field in MODELS:
        model = FIT_AS.get((field, theory))
        if model is None:
            continue
        try:
            fit = fit_runs(
                [done.run],
                model=model,
                support=done.support,
                judged=False,
                sources=done.sources if field == "magnet" else None,
            )
        except MagbendError as error:
            more += [
                replace(one, moduli="refitted", status=f"no fit: {error}", errors=None)
                for one in done.of(field)
            ]
            continue
        again = compare_run(
            done.run,
            specimen=fit.specimen,
            support=done.support,
            model=theory,
            sources=done.sources,
        )
        more += [replace(one, moduli="refitted") for one in again.of(field)]
    return replace(done, comparisons=(*done.comparisons, *more))
