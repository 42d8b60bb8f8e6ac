"""What is installed, which ports and cameras answer, what is missing."""

from __future__ import annotations

import importlib
import os
import platform
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ..core.errors import how_to_install

REQUIRED = (
    "numpy",
    "scipy",
    "numba",
    "pandas",
    "matplotlib",
    "opencv-python-headless",
    "pyserial",
    "typer",
    "pydantic",
    "rich",
    "jinja2",
)
EXTRAS = {
    "panel": ("starlette", "uvicorn", "websockets", "tomlkit"),
    "heic": ("pillow-heif",),
    "excel": ("openpyxl",),
    "hdf5": ("h5py",),
    "meters": ("pyvisa",),
    "library": ("pyarrow",),
    "cluster": ("dask", "distributed"),
    "train": ("jax", "optax"),
    "bayes": ("emcee",),
}
GMC2_TIP_MM = (29.5353236353478, 4.70952405678937)
"""Tip of GMC 2 at 50 mT and 90 deg, from an independent shooting solution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line of the doctor's report.

    Parameters
    ----------
    subject : str
        What was looked at.
    status : {"ok", "absent", "broken"}
        ``absent`` is a fact (an optional package, no camera); ``broken`` wants a cure.
    detail : str
        What was found, and the way out where something is wrong.
    """

    subject: str
    status: str
    detail: str


def examine() -> list[Finding]:
    """Look at the installation and the devices; takes a few seconds, moves nothing."""
    return [
        Finding(
            subject="system",
            status="ok",
            detail=f"magbend {version('magbend')}, Python {platform.python_version()}, "
            f"{platform.platform()}, {os.cpu_count()} cores",
        ),
        _required(),
        *_extras(),
        _kernel_cache(),
        _self_test(),
        *_ports(),
        *_cameras(),
    ]


def as_dicts(findings: list[Finding]) -> list[dict[str, Any]]:
    """Return the findings for JSON."""
    return [asdict(finding) for finding in findings]


def _installed(names: tuple[str, ...]) -> tuple[list[str], list[str]]:
    present, missing = [], []
    for name in names:
        try:
            present.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            missing.append(name)
    return present, missing


def _required() -> Finding:
    present, missing = _installed(REQUIRED)
    if missing:
        detail = f"missing: {', '.join(missing)}; to repair magbend, {how_to_install()}"
        return Finding(subject="packages", status="broken", detail=detail)
    return Finding(subject="packages", status="ok", detail=", ".join(present))


def _extras() -> list[Finding]:
    findings = []
    for extra, names in EXTRAS.items():
        present, missing = _installed(names)
        if missing:
            detail = f"not installed; if wanted, {how_to_install(extra)}"
            status = "absent"
        else:
            detail, status = ", ".join(present), "ok"
        findings.append(Finding(subject=f"extra {extra}", status=status, detail=detail))
    return findings


def _kernel_cache() -> Finding:
    """Compiled kernels are kept between runs only where the user may write."""
    from ..sim import march

    folder = march.cache_folder
    if folder:
        return Finding(subject="kernel cache", status="ok", detail=folder)
    detail = (
        "no folder can be written: every command compiles its kernels anew, up to a "
        "minute; set NUMBA_CACHE_DIR to a folder of yours"
    )
    return Finding(subject="kernel cache", status="absent", detail=detail)


def _self_test() -> Finding:
    from ..sim import UniformField, gmc, solve

    solution = solve(gmc(2), UniformField(flux_mT=50.0, angle_deg=90.0))
    if solution.centreline is None:
        return Finding(subject="self-test", status="broken", detail=solution.status)
    tip_mm = solution.centreline.tip_mm
    error_mm = max(abs(a - b) for a, b in zip(tip_mm, GMC2_TIP_MM, strict=True))
    detail = (
        f"GMC 2 at 50 mT: tip ({tip_mm[0]:.5f}, {tip_mm[1]:.5f}) mm, "
        f"{error_mm:.1e} mm from the reference"
    )
    status = "ok" if error_mm < 1e-6 else "broken"
    return Finding(subject="self-test", status=status, detail=detail)


def _ports() -> list[Finding]:
    from serial.tools import list_ports

    ports = sorted(list_ports.comports())
    if not ports:
        detail = "none found; plug the board in, then: magbend rig ports"
        return [Finding(subject="serial ports", status="absent", detail=detail)]
    return [_port(port) for port in ports]


def _port(port: Any) -> Finding:
    """Judge a port by its permissions: opening it would restart many boards."""
    subject = f"port {port.device}"
    if Path(port.device).exists() and not os.access(port.device, os.R_OK | os.W_OK):
        detail = (
            "may not be opened by this user; on Linux add the user to the group "
            "dialout and log in again"
        )
        return Finding(subject=subject, status="broken", detail=detail)
    detail = port.description if port.vid else "no USB device known behind it"
    return Finding(subject=subject, status="ok", detail=detail)


def _cameras() -> list[Finding]:
    indices = _camera_indices()
    findings = [finding for index in indices if (finding := _camera(index))]
    if findings:
        return findings
    detail = "none answers; a camera may also be a URL, a video or a folder of images"
    return [Finding(subject="cameras", status="absent", detail=detail)]


def _camera_indices() -> list[int]:
    if sys.platform.startswith("linux"):
        nodes = Path("/dev").glob("video*")
        return sorted(int(n.name[5:]) for n in nodes if n.name[5:].isdecimal())[:8]
    return list(range(3))


def _camera(index: int) -> Finding | None:
    cv2 = importlib.import_module("cv2")
    logging = cv2.utils.logging
    logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(index)
    try:
        if not capture.isOpened():
            return None
        good, frame = capture.read()
        if not good:
            detail = "opens but gives no frame; is another program using it?"
            return Finding(subject=f"camera {index}", status="broken", detail=detail)
        height, width = frame.shape[:2]
        return Finding(
            subject=f"camera {index}", status="ok", detail=f"{width} x {height} px"
        )
    finally:
        capture.release()
