"""The files of one bench: rig, plan, specimen, calibration, runs, and what is wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.checks import shown
from ..core.door import real_path
from ..core.errors import ConfigError, InputError, MagbendError
from ..core.json import read_json
from ..core.specimen import Specimen
from ..core.specimen_file import read_specimen

if TYPE_CHECKING:
    from ..rig import Plan, RigModel
    from ..vision import Calibration

RUNS = "runs"


def utc_now() -> str:
    """Return the time of day in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def now_name() -> str:
    """Return the time here, as names of folders begin with it."""
    return f"{datetime.now().astimezone():%Y-%m-%d_%H%M%S}"


_FIT_MB = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedRod:
    """The rod with the moduli that the newest fit found, and the run it comes from."""

    specimen: Specimen
    run: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchFiles:
    """What the files of a bench say; a file that cannot be used is a sentence.

    Parameters
    ----------
    rig, plan, specimen, calibration, fitted
        As read; None where the file is missing or wrong.
    problems : dict of str to str
        ``rig``, ``plan``, ``specimen`` or ``calibration`` to what is wrong with it.
    """

    rig: RigModel | None
    plan: Plan | None
    specimen: Specimen | None
    calibration: Calibration | None
    fitted: FittedRod | None
    problems: dict[str, str]


class Workspace:
    """The folder of a bench; files are read again when they change.

    Parameters
    ----------
    rig : Path
        The rig file; it need not exist yet. Plan, specimen, calibration and runs are
        beside it.
    """

    def __init__(self, rig: Path) -> None:
        self.rig_path = real_path(rig)
        self.folder = self.rig_path.parent
        self._stamp: object = None
        self._files: BenchFiles | None = None

    @property
    def plan_path(self) -> Path:
        """The plan file."""
        return self.folder / "plan.toml"

    @property
    def specimen_path(self) -> Path:
        """The specimen file."""
        return self.folder / "specimen.toml"

    @property
    def calibration_path(self) -> Path:
        """The camera's calibration."""
        return self.folder / "calibration.json"

    @property
    def runs_path(self) -> Path:
        """The folder of the runs."""
        return self.folder / RUNS

    def run_path(self, name: str) -> Path:
        """Return the folder of a run by its name; names cannot lead elsewhere.

        Raises
        ------
        InputError
            If there is no such run.
        """
        # The names that are there, asked one by one: none is too long or leads out.
        folders = self.runs_path.iterdir() if self.runs_path.is_dir() else ()
        found = next((one for one in folders if one.name == name), None)
        if found is None or name.startswith(".") or not found.is_dir():
            raise InputError(f"there is no run {shown(name)} in {self.runs_path}")
        return found

    def files(self) -> BenchFiles:
        """Return what the files say now."""
        stamp = tuple(_stamp(path) for path in self._watched())
        if self._files is None or stamp != self._stamp:
            self._files, self._stamp = self._read(), stamp
        return self._files

    def _watched(self) -> list[Path]:
        fixed = [
            self.rig_path, self.plan_path, self.specimen_path, self.calibration_path,
        ]  # fmt: skip
        return [*fixed, *sorted(self.runs_path.glob("*/fit.json"))]

    def _read(self) -> BenchFiles:
        from ..rig import read_plan, read_rig

        problems: dict[str, str] = {}
        rig = _try(problems, "rig", lambda: read_rig(self.rig_path))
        plan = None
        if rig is not None:
            plan = _try(problems, "plan", lambda: read_plan(self.plan_path))
        specimen = plan.specimen if plan else None
        if specimen is None and self.specimen_path.exists():
            specimen = _try(
                problems, "specimen", lambda: read_specimen(self.specimen_path)
            )
        calibration = None
        if self.calibration_path.exists():
            calibration = _try(problems, "calibration", self._calibration)
        fitted = self._fitted(specimen) if specimen else None
        return BenchFiles(
            rig=rig, plan=plan, specimen=specimen, calibration=calibration,
            fitted=fitted, problems=problems,
        )  # fmt: skip

    def _calibration(self) -> Calibration:
        from ..vision import read_calibration

        return read_calibration(self.calibration_path)

    def _fitted(self, specimen: Specimen) -> FittedRod | None:
        """Return the rod of the newest fit that knows every modulus."""
        newest = sorted(self.runs_path.glob("*/fit.json"), key=_stamp, reverse=True)
        for path in newest:
            E_MPa = _moduli(path, specimen)
            if E_MPa:
                sections = tuple(
                    replace(section, E_MPa=value)
                    for section, value in zip(specimen.sections, E_MPa, strict=True)
                )
                rod = replace(specimen, sections=sections)
                return FittedRod(specimen=rod, run=path.parent.name)
        return None


def _try(problems: dict[str, str], name: str, read: Any) -> Any:
    try:
        return read()
    except MagbendError as error:
        problems[name] = str(error)
        return None


def _stamp(path: Path) -> tuple[float, int]:
    try:
        status = path.stat()
    except OSError:
        return (0.0, 0)
    return (status.st_mtime, status.st_size)


def _moduli(path: Path, specimen: Specimen) -> list[float] | None:
    """Return the moduli in a fit's file, or None if it does not know them all."""
    try:
        data = read_json(path, most_MB=_FIT_MB)
        values = [float(value) for value in data["E_MPa"]]
        of = data["specimen"]
    except (ValueError, TypeError, KeyError):
        return None
    known = len(values) == len(specimen.sections) and all(v > 0.0 for v in values)
    return values if known and of == specimen.name else None


def require(value: Any, problems: dict[str, str], name: str) -> Any:
    """Return a file's content, or raise what is wrong with the file.

    Raises
    ------
    ConfigError
        If it is missing or wrong.
    """
    if value is None:
        raise ConfigError(problems.get(name, f"there is no {name} file yet: set it up"))
    return value
