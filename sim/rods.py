"""The rod of every solver, under the name that the field knows it by."""

from __future__ import annotations

from ..core.profile import profile_sections
from ..core.specimen import Section, Specimen

Rod = Specimen
"""One class for plane and space: `Specimen`."""

__all__ = ["Rod", "Section", "profile_sections"]
