"""Readings along the stage, with the probe in place of the rod."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import RigError, StoreError
from ...core.files import write_text
from ...core.owned import owning_folder
from ...core.progress import Progress, silent
from ..bench.devices import Devices
from ..clock import Check, wait
from ..errors import StoppedError
from ..interrupts import heed_interrupts
from ..meter.protocol import Flux
from ..stage.gap import GapStage
from ..wire_log import WireLog
from .control import Report, quiet
from .records import WIRE_FILE

TABLE = "field.csv"
COLUMNS = "gap_mm,flux_mT,sd_mT,n"
_COLUMNS_WITHOUT_SD = "gap_mm,flux_mT,n"


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldScan:
    """What was read.

    Parameters
    ----------
    path : Path
        The table: one row a gap with a good reading.
    gaps_mm, flux_mT : tuple of float
        The rows of the table.
    sd_mT : tuple of float or None
        Standard deviation of the samples of each row; None with one sample.
    skipped : tuple of str
        Gaps without a reading, and why: overload is not a number.
    """

    path: Path
    gaps_mm: tuple[float, ...]
    flux_mT: tuple[float, ...]
    sd_mT: tuple[float | None, ...]
    skipped: tuple[str, ...]


def scan_field(
    devices: Devices,
    gaps_mm: Sequence[float],
    out: Path,
    *,
    samples: int = 20,
    settle_s: float = 1.0,
    report: Report = quiet,
    progress: Progress = silent,
) -> FieldScan:
    """Read the Tesla-meter at each gap and write ``field.csv``.

    The table is rewritten, whole, after each gap, so that an interrupted scan keeps
    what it has.

    Parameters
    ----------
    devices : Devices
        Open; the camera is not used.
    gaps_mm : sequence of float
        Gaps, far to near.
    out : Path
        Folder for ``field.csv``; made if missing.
    samples : int
        Readings a gap.
    settle_s : float
        Wait after arrival.
    report, progress : callable
        Told what is read.

    Raises
    ------
    StoreError
        If ``field.csv`` is there already or cannot be written.
    StoppedError
        On Ctrl-C, SIGTERM or ``magbend rig stop``; the stage stands.
    StageError, MeterError
        If a device fails; the stage stands.
    """
    stage = devices.stage
    for gap_mm in gaps_mm:
        stage.check_gap(gap_mm)
    rows: list[tuple[float, Flux]] = []
    skipped: list[str] = []
    with (
        owning_folder(out, "scan", "rig scan-field"),
        _standing_at_the_end(stage, out / TABLE) as check,
    ):
        path = _new_table(out, devices.log)
        if stage.position_state != "homed":
            report("homing the stage")
            stage.home()
        for done, gap_mm in enumerate(gaps_mm, start=1):
            stage.goto_gap(gap_mm)
            wait(devices.clock, settle_s, check)
            flux = devices.meter.read_flux(samples, gap_mm=gap_mm, check=check)
            if flux.flux_mT is None:
                skipped.append(f"{gap_mm:g} mm: {flux.status}")
                report(f"gap {gap_mm:g} mm: no reading ({flux.status})")
            else:
                rows.append((gap_mm, flux))
                report(f"gap {gap_mm:g} mm: {_shown(flux)}")
            _write(path, rows)
            progress(done, len(gaps_mm))
    return FieldScan(
        path=path,
        gaps_mm=tuple(gap for gap, _ in rows),
        flux_mT=tuple(flux.flux_mT for _, flux in rows if flux.flux_mT is not None),
        sd_mT=tuple(flux.sd_mT for _, flux in rows),
        skipped=tuple(skipped),
    )


@contextlib.contextmanager
def _standing_at_the_end(stage: GapStage, path: Path) -> Iterator[Check]:
    """Yield what every wait calls; whatever ends the scan, the stage stands."""
    with heed_interrupts(stage.request_stop) as received:

        def check() -> None:
            if stage.stop_requested():
                raise StoppedError("the scan was stopped by magbend rig stop")
            stage.listen()

        try:
            with received.striking():
                yield check
        except (KeyboardInterrupt, RigError) as error:
            stage.hold()
            if received.name:
                raise StoppedError(
                    f"stopped by {received.name}; {path} holds what was read"
                ) from error
            raise


def _new_table(out: Path, log: WireLog | None) -> Path:
    path = out / TABLE
    if path.exists():
        raise StoreError(f"{path}: is there already; name another folder with --out")
    try:
        write_text(path, COLUMNS + "\n")
        if log is not None:
            log.start(out / WIRE_FILE)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _write(path: Path, rows: Sequence[tuple[float, Flux]]) -> None:
    # Typed readings have no scatter; an empty cell would be refused by every reader.
    has_sd = all(flux.sd_mT for _, flux in rows)
    lines = [COLUMNS if has_sd else _COLUMNS_WITHOUT_SD]
    for gap_mm, flux in rows:
        sd = [f"{flux.sd_mT:.6g}"] if has_sd else []
        row = [f"{gap_mm:.6g}", f"{flux.flux_mT:.8g}", *sd, str(flux.samples)]
        lines.append(",".join(row))
    try:
        write_text(path, "\n".join(lines) + "\n")
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from None


def _shown(flux: Flux) -> str:
    sd = "" if flux.sd_mT is None else f" +- {flux.sd_mT:.3f}"
    return f"{flux.flux_mT:.3f}{sd} mT ({flux.samples} readings)"
