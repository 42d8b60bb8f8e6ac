"""Stage, camera, Tesla-meter, the runner and the run folder; and their twins.

The names are listed in ``__init__.pyi`` and loaded when first used, so that a command
pays only for what it needs.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
