"""From specimens and fields to kernel arrays: the only place, of one rod or many."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
