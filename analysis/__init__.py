"""Runs against theory: compare, fit, report, train, search and design.

For notebooks: ``analysis.load_run(path)`` gives tidy tables, ``analysis.compare_run``
sets them beside the simulation, ``analysis.fit_runs`` fits the moduli. Names are loaded
when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .compare import compare_run, comparison_table
    from .fit import fit_runs
    from .load import load_run
    from .report import write_report

_HOME = {
    "compare_run": "compare",
    "comparison_table": "compare",
    "fit_runs": "fit",
    "load_run": "load",
    "write_report": "report",
}

__all__ = ["compare_run", "comparison_table", "fit_runs", "load_run", "write_report"]


def __getattr__(name: str) -> object:
    """Load a public name from the module that holds it."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted(__all__)
