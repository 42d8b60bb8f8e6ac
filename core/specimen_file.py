"""Specimen and magnet files (DESIGN, section 4): TOML to dataclasses and back."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, PositiveFloat

from .magnet import Magnet, Vector
from .specimen import Section, Specimen
from .toml import FileModel, read_toml


class SectionModel(FileModel):
    """One ``[[section]]`` of a specimen file, root first."""

    length_mm: PositiveFloat
    E_MPa: PositiveFloat
    side_mm: PositiveFloat | None = None
    remanence_mT: float | None = None


class SpecimenModel(FileModel):
    """A specimen file, or the specimen inside a plan."""

    name: str
    side_mm: PositiveFloat
    remanence_mT: float
    density_kg_m3: PositiveFloat | None = None
    section: list[SectionModel] = Field(min_length=1)

    def specimen(self) -> Specimen:
        """Return the specimen it describes."""
        return Specimen(
            name=self.name,
            side_mm=self.side_mm,
            remanence_mT=self.remanence_mT,
            density_kg_m3=self.density_kg_m3,
            sections=tuple(Section(**dict(section)) for section in self.section),
        )


class MagnetModel(FileModel):
    """A magnet file, or the magnet inside a rig file."""

    side_mm: PositiveFloat | None = None
    sides_mm: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    remanence_T: float
    axis_angle_deg: float = 90.0
    elevation_deg: float = 0.0
    offset_mm: Vector = (0.0, 0.0, 0.0)

    def model_post_init(self, _context: object) -> None:
        """Check that exactly one of side_mm and sides_mm is given."""
        if (self.side_mm is None) == (self.sides_mm is None):
            raise ValueError("give either side_mm (a cube) or sides_mm (three sides)")

    def magnet(self) -> Magnet:
        """Return the magnet it describes."""
        sides_mm = self.sides_mm or (self.side_mm or 0.0,) * 3
        return Magnet(
            sides_mm=sides_mm,
            remanence_T=self.remanence_T,
            axis_angle_deg=self.axis_angle_deg,
            elevation_deg=self.elevation_deg,
            offset_mm=self.offset_mm,
        )


def read_specimen(path: Path) -> Specimen:
    """Read a specimen file (TOML, or the same keys as JSON).

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    return read_toml(path, SpecimenModel).specimen()


def read_magnet(path: Path) -> Magnet:
    """Read a magnet file (TOML, or the same keys as JSON).

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    return read_toml(path, MagnetModel).magnet()


def specimen_dict(specimen: Specimen) -> dict[str, object]:
    """Return the specimen with the keys of its file, optional keys only where set."""
    data: dict[str, object] = {
        "name": specimen.name,
        "side_mm": specimen.side_mm,
        "remanence_mT": specimen.remanence_mT,
    }
    if specimen.density_kg_m3 is not None:
        data["density_kg_m3"] = specimen.density_kg_m3
    data["section"] = [
        {
            key: value
            for key in ("length_mm", "E_MPa", "side_mm", "remanence_mT")
            if (value := getattr(section, key)) is not None
        }
        for section in specimen.sections
    ]
    return data
