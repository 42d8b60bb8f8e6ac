"""Photographs with exactly known truth, to measure the measuring.

`draw` and `frames` draw squarely seen rods; `render_scene` draws a whole bench in true
perspective; `score` holds a measurement against the truth.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
