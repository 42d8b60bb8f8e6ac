"""Many rods through one lumen, on all cores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...core.errors import SolverError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ..batch.threads import in_threads
from ..tube.tube import Tube
from .case import FieldOfWay
from .lumen import Lumen
from .passage import Passage
from .solver import navigate


def navigate_many(
    specimens: Sequence[Specimen],
    lumen: Lumen | Tube,
    field: FieldOfWay,
    *,
    progress: Progress = silent,
    threads: int | None = None,
    **options: Any,
) -> list[Passage | None]:
    """Push rods through a lumen, each by itself.

    Parameters
    ----------
    specimens : sequence of Specimen
        The rods.
    lumen, field
        As of `navigate`.
    progress : callable
        Called as ``progress(done, total)``.
    threads : int, optional
        All cores, by default.
    **options
        As of `navigate`, the same for all; `refine` is off unless asked for.

    Returns
    -------
    list of Passage or None
        None where not even the first step has an equilibrium that could be found.

    Raises
    ------
    InputError
        As `navigate`, for the first rod that cannot be.
    """
    found: list[Passage | None] = [None] * len(specimens)
    options = {"refine": False} | options

    def work(rows: slice) -> None:
        for i in range(rows.start, rows.stop):
            try:
                found[i] = navigate(specimens[i], lumen, field, **options)
            except SolverError:
                found[i] = None

    in_threads(work, len(specimens), 1, threads=threads, progress=progress)
    return found
