"""Specimen and magnet files (DESIGN, section 4): TOML to dataclasses and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import ConfigDict, Field, NonNegativeFloat, PositiveFloat

from .cross_section import ALL_SIZES, SIZES
from .errors import ConfigError, InputError
from .magnet import Magnet, Vector
from .profile import profile_sections
from .specimen import Section, Specimen
from .toml import FileModel, read_toml

Built = TypeVar("Built")

PARTS = ("section", "profile")
"""Keys by which a rod is divided."""


class SectionModel(FileModel):
    """One ``[[section]]`` of a specimen file, root first."""

    length_mm: PositiveFloat
    E_MPa: PositiveFloat
    side_mm: PositiveFloat | None = None
    remanence_mT: float | None = None
    width_mm: PositiveFloat | None = None
    height_mm: PositiveFloat | None = None
    diameter_mm: PositiveFloat | None = None
    bore_mm: PositiveFloat | None = None
    remanence_y_mT: float | None = None
    remanence_z_mT: float | None = None
    natural_curvature_per_mm: float | None = None


class ProfileModel(FileModel):
    """A ``[profile]`` instead of sections: values along the rod, linear between."""

    model_config = ConfigDict(extra="allow")
    s_mm: list[float]
    E_MPa: list[float]
    pieces: int = 60


class SpecimenModel(FileModel):
    """A specimen file, or the specimen inside a plan."""

    name: str
    shape: Literal["square", "rectangle", "round", "tube"] = "square"
    side_mm: PositiveFloat | None = None
    width_mm: PositiveFloat | None = None
    height_mm: PositiveFloat | None = None
    diameter_mm: PositiveFloat | None = None
    bore_mm: PositiveFloat | None = None
    remanence_mT: float
    remanence_y_mT: float = 0.0
    remanence_z_mT: float = 0.0
    natural_curvature_per_mm: float = 0.0
    density_kg_m3: PositiveFloat | None = None
    poisson_ratio: float = 0.49
    side_sd_mm: NonNegativeFloat | None = None
    length_sd_mm: NonNegativeFloat | None = None
    remanence_sd_mT: NonNegativeFloat | None = None
    density_sd_kg_m3: NonNegativeFloat | None = None
    natural_curvature_sd_per_mm: NonNegativeFloat | None = None
    recipe: dict[str, float | str] = Field(default_factory=dict)
    colour: str | None = None
    section: list[SectionModel] = Field(default_factory=list)
    profile: ProfileModel | None = None

    def model_post_init(self, _context: object) -> None:
        """Check that the sizes are those of the shape."""
        missing = [name for name in SIZES[self.shape] if getattr(self, name) is None]
        if missing:
            what = f"{missing[0]!r} is missing: the shape is {self.shape}"
            raise ValueError(f"{what}{self._other_shape()}")
        if bool(self.section) == (self.profile is not None):
            raise ValueError("give either [[section]] tables or one [profile]")

    def _other_shape(self) -> str:
        """Return words for the shape that the given sizes belong to, if any."""
        fits = [
            shape
            for shape, sizes in SIZES.items()
            if all(getattr(self, name) is not None for name in sizes)
        ]
        return f'; these sizes belong to shape = "{fits[-1]}"' if fits else ""

    def specimen(self) -> Specimen:
        """Return the specimen it describes."""
        given = {
            name: value
            for name in type(self).model_fields
            if (value := getattr(self, name)) is not None
            and name not in ("section", "profile")
        }
        if self.profile is not None:
            sections = profile_sections(**self.profile.model_dump())
        else:
            sections = tuple(Section(**dict(section)) for section in self.section)
        return Specimen(**given, sections=sections)


class MagnetModel(FileModel):
    """A magnet file, or the magnet inside a rig file."""

    side_mm: PositiveFloat | None = None
    sides_mm: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    remanence_T: float
    axis_angle_deg: float = 90.0
    elevation_deg: float = 0.0
    offset_mm: Vector = (0.0, 0.0, 0.0)
    remanence_sd_T: NonNegativeFloat | None = None

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
            remanence_sd_T=self.remanence_sd_T,
        )


def read_specimen(path: Path) -> Specimen:
    """Read a specimen file (TOML, or the same keys as JSON).

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    return _built(path, read_toml(path, SpecimenModel).specimen)


def read_magnet(path: Path) -> Magnet:
    """Read a magnet file (TOML, or the same keys as JSON).

    Raises
    ------
    ConfigError
        One sentence with file, line and key.
    """
    return _built(path, read_toml(path, MagnetModel).magnet)


def _built(path: Path, build: Callable[[], Built]) -> Built:
    """Return what a file describes; what is wrong with it is said of the file."""
    try:
        return build()
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from None


def specimen_dict(specimen: Specimen) -> dict[str, object]:
    """Return the specimen with the keys of its file, optional keys only where set."""
    data: dict[str, object] = {"name": specimen.name}
    usual = {field.name: field.default for field in fields(Specimen)}
    for key in SpecimenModel.model_fields:
        value = getattr(specimen, key, None)
        if key in (*SIZES[specimen.shape], "remanence_mT") or (
            key not in ("name", "section", "profile", "recipe", *ALL_SIZES)
            and value != usual[key]
        ):
            data[key] = value
    if specimen.recipe:
        data["recipe"] = dict(specimen.recipe)
    data["section"] = [
        {
            key: value
            for key in SectionModel.model_fields
            if (value := getattr(section, key)) is not None
        }
        for section in specimen.sections
    ]
    return data
