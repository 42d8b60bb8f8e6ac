"""The control panel: the bench on one local page, theory drawn over the live picture.

The page calls the functions and the control socket that the command line calls; nothing
can be done here that cannot be scripted. The names are listed in ``__init__.pyi``.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
