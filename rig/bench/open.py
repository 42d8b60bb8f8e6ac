"""From a rig file to open devices."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path

from ...core.errors import CameraError, ConfigError, MeterError
from ...core.plugin_options import checked_options
from ...core.plugins import load_plugin, offered
from ...core.urls import without_secrets
from ..axes.line import Axis
from ..camera.capture import CaptureCamera, Source
from ..camera.config import OWN_BACKENDS, CameraConfig
from ..camera.protocol import Camera, NoCamera
from ..clock import Clock
from ..meter.config import MeterConfig
from ..meter.protocol import Ask, ManualMeter, Meter, NoMeter
from ..stage.gap import GapStage
from ..wire_log import WireLog
from .config import Plan, RigModel
from .devices import Devices

_CAMERA_SETTINGS = (
    "exposure", "gain", "white_balance_K", "focus", "width_px", "height_px",
)  # fmt: skip


def open_camera(config: CameraConfig, folder: Path, clock: Clock) -> Camera:
    """Open the camera of a rig file.

    Parameters
    ----------
    config : CameraConfig
        Its ``[camera]`` table.
    folder : Path
        The folder of the rig file: relative paths start there.
    clock : Clock
        Time.

    Raises
    ------
    CameraError
        If it cannot be opened or gives no picture.
    ConfigError
        If it is the twin's (`magbend.analysis.twin.bench` makes that one), or a setting
        is asked for that the backend cannot make.
    """
    source = config.source
    backend = (
        config.backend if config.backend != "auto" else _backend_of(source, folder)
    )
    if backend == "twin":
        raise ConfigError(
            "camera.backend twin is the computed bench: it needs the twin's devices "
            "(magbend.analysis.twin.bench)"
        )
    if backend not in OWN_BACKENDS:
        plugin = load_plugin("magbend.cameras", backend, own=OWN_BACKENDS)
        options = checked_options(plugin, config.options, "camera.options")
        return CaptureCamera(
            lambda: plugin(config, options, clock), str(source), config, clock
        )
    if backend != "opencv":
        _refuse_settings(config, backend)
    if backend in ("folder", "video"):
        return _open_files(config, backend, folder / str(source), clock)
    make: Callable[[], Source]
    if backend == "mjpeg":
        from ..camera.mjpeg import MjpegSource, prepare

        prepare()
        url = str(source)
        if not url.startswith(("http://", "https://")):
            raise ConfigError(
                f"camera.source must be an http:// or https:// address for the backend "
                f"mjpeg; instead received {without_secrets(url)!r}"
            )
        make = lambda: MjpegSource(url, clock, timeout_s=config.frame_timeout_s)  # noqa: E731
    else:
        from ..camera.opencv import OpenCvSource

        device = int(source) if str(source).isdecimal() else source
        make = lambda: OpenCvSource(device, config, clock)  # noqa: E731
    return CaptureCamera(make, without_secrets(str(source)), config, clock)


def _refuse_settings(config: CameraConfig, backend: str) -> None:
    for name in _CAMERA_SETTINGS:
        if getattr(config, name) is not None:
            raise ConfigError(
                f"camera.{name} cannot be set through the backend {backend}: it only "
                "receives pictures; set it at the camera or its program, and leave "
                "the key out"
            )


def _open_files(config: CameraConfig, backend: str, path: Path, clock: Clock) -> Camera:
    from ..camera.files import FolderCamera, VideoCamera, WatchedFolderCamera

    if backend == "video":
        return VideoCamera(path, clock)
    if config.watch:
        return WatchedFolderCamera(path, clock, timeout_s=config.frame_timeout_s)
    return FolderCamera(path, clock)


def _backend_of(source: str | int, folder: Path) -> str:
    text = str(source)
    if text.startswith(("http://", "https://")):
        return "mjpeg"
    if text.isdecimal() or "://" in text or text.startswith("/dev/"):
        return "opencv"
    path = folder / text
    if path.is_dir():
        return "folder"
    if path.is_file():
        return "video"
    raise CameraError(
        f"camera.source must be a device number, an address, a folder or a video; "
        f"instead received {without_secrets(text)!r}, and {path} does not exist"
    )


def open_meter(
    config: MeterConfig,
    folder: Path,
    *,
    readings_mT: Mapping[float, float] | None = None,
    ask: Ask | None = None,
    log: WireLog | None = None,
) -> Meter:
    """Open the Tesla-meter of a rig file.

    Parameters
    ----------
    config : MeterConfig
        Its ``[meter]`` table.
    folder : Path
        The folder of the rig file.
    readings_mT : mapping of float to float, optional
        Typed readings in mT per gap in mm; they replace the meter.
    ask : callable, optional
        Asks the person at the bench, where the driver is ``manual``.
    log : WireLog, optional
        Where every byte is recorded.

    Raises
    ------
    MeterError
        If it cannot be opened or does not tell its unit.
    ConfigError
        If its description is wrong, or the port is missing.
    """
    if readings_mT is not None or config.driver == "manual":
        return ManualMeter(readings_mT or {}, ask)
    if config.driver == "none":
        return NoMeter()
    if config.driver == "twin":
        raise ConfigError(
            "meter.driver twin is the computed bench: it needs the twin's devices "
            "(magbend.analysis.twin.bench)"
        )
    if config.driver in offered("magbend.meters"):
        plugin = load_plugin("magbend.meters", config.driver)
        meter: Meter = plugin(
            config, checked_options(plugin, config.options, "meter.options")
        )
        return meter
    from ..meter.description import read_description
    from ..meter.serial import SerialMeter

    path = folder / config.description if config.description else None
    description = read_description(config.driver, path)
    if not config.port:
        raise MeterError(
            f"meter.port must name the port of the {description.name}; "
            f"`magbend rig ports` lists what is there"
        )

    def tap(direction: str, data: bytes) -> None:
        if log is not None:
            log.record("meter", direction, data)

    return SerialMeter(
        description, config.port, zero_mT=config.zero_mT, sign=config.sign, tap=tap
    )


def open_stage(rig: RigModel, clock: Clock, *, log: WireLog | None = None) -> GapStage:
    """Open and connect the stage of a rig file; nothing moves.

    Raises
    ------
    StageError
        If nobody answers, or a setting of the controller does not fit the rig file.
    """
    from ..stage.make import make_stage

    stage = GapStage(
        make_stage(rig.stage, clock, log=log), rig.stage, rig.limits, clock
    )
    stage.connect()
    return stage


def open_devices(
    plan: Plan,
    clock: Clock,
    *,
    log: WireLog | None = None,
    readings_mT: Mapping[float, float] | None = None,
    ask: Ask | None = None,
    with_camera: bool = True,
) -> Devices:
    """Open every device that a plan needs, or none.

    Parameters
    ----------
    plan : Plan
        The plan with its rig.
    clock : Clock
        Time; `SystemClock` on hardware.
    log : WireLog, optional
        Where every byte is recorded.
    readings_mT : mapping of float to float, optional
        Typed readings that replace the meter.
    ask : callable, optional
        Asks the person at the bench, where the meter is ``manual``.
    with_camera : bool
        False where no picture is taken (scan-field).

    Raises
    ------
    RigError
        If one of them cannot be opened; those that were open are closed again.
    """
    folder = plan.rig_path.parent
    with contextlib.ExitStack() as opened:
        stage = open_stage(plan.rig, clock, log=log)
        opened.callback(stage.close)
        meter = open_meter(
            plan.rig.meter, folder, readings_mT=readings_mT, ask=ask, log=log
        )
        opened.callback(meter.close)
        camera: Camera = NoCamera()
        if with_camera:
            camera = open_camera(plan.rig.camera, folder, clock)
            opened.callback(camera.close)
        axes: dict[str, Axis] = {}
        for scan in (*plan.model.scan, *plan.model.along):
            axes[scan.axis] = _open_axis(plan.rig, scan.axis, clock, log)
            opened.callback(axes[scan.axis].close)
        opened.pop_all()
    return Devices(
        stage=stage, camera=camera, meter=meter, clock=clock, log=log, axes=axes
    )


def _open_axis(rig: RigModel, name: str, clock: Clock, log: WireLog | None) -> Axis:
    from ..axes.line import LineAxis

    config = next(axis for axis in rig.axis if axis.name == name)
    if config.driver == "twin":
        raise ConfigError(
            f"axis {name}: driver twin is the computed bench: name its real driver"
        )
    return LineAxis(config, clock, log=log)
