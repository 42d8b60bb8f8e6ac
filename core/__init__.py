"""What the parts share: errors, units, the specimen, the magnet, the centreline.

Nothing here imports more than numpy, and the names of the face, listed in
``__init__.pyi``, are loaded when first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
