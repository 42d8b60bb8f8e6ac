"""Runs against theory: compare, fit, report, train, search and design.

For notebooks: ``analysis.load_run(path)`` gives tidy tables, ``analysis.compare_run``
sets them beside the simulation, ``analysis.fit_runs`` fits the moduli. The names are
listed in ``__init__.pyi`` and loaded when first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
