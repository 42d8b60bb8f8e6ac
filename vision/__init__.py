"""Photographs to calibrated centrelines in mm.

`calibrate` turns photographs of a board into a `Calibration`; `extract` turns one
photograph into a `Measurement`, `extract_files` many into tables;
`magbend.vision.synthetic` draws photographs with exactly known truth. The names are
listed in ``__init__.pyi`` and loaded when first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
