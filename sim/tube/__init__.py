"""Tubes around curves in space, and rods at rest in them (`docs/navigation.md`)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
