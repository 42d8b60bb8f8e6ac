"""``magbend rig snapshot``: a picture with the bench camera, as a run takes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.errors import ConfigError, StoreError
from .console import print_json, say
from .keys import terminating
from .rig_ask import RIG, JsonOption, RigOption

EXAMPLE = "Example: magbend rig snapshot --out board.png"


def register(app: typer.Typer) -> None:
    """Add the command of this module to the group ``rig``."""
    app.command("snapshot", epilog=EXAMPLE)(snapshot)


def snapshot(
    out: Annotated[Path, typer.Option(help="The picture to write (PNG).")],
    rig: RigOption = RIG,
    frames: Annotated[
        int, typer.Option(min=1, max=99, help="Pixel-wise median of so many.")
    ] = 3,
    as_json: JsonOption = False,
) -> None:
    """Take a picture with the bench camera, with the settings of a run.

    Photograph the calibration board so, and look at focus and light before a run.
    Nothing moves.
    """
    from ..rig import BenchState, owning, read_rig

    table = read_rig(rig)
    if table.camera.backend == "twin":
        raise ConfigError(
            f"{rig}: camera.backend is the computed bench, which leaves board.png in "
            "the folder of its run; snapshot is for a real camera"
        )
    if out.exists():
        raise StoreError(f"{out}: is there already; name another file")
    with (
        owning(rig, table.stage.port, BenchState(), command="rig snapshot"),
        terminating(),
    ):
        data = _take(rig, table, out, frames)
    if as_json:
        print_json(data)
        return
    say(
        f"{out}: {data['width_px']} x {data['height_px']} pixels, brightness "
        f"{data['brightness']:.2f}, sharpness {data['sharpness']:.4f}"
    )
    for note in [*data["flags"], *data["notes"]]:
        say(f"note: {note}", err=True)


def _take(rig: Path, table: Any, out: Path, frames: int) -> dict[str, Any]:
    """Photograph, write the picture, and return what can be said of it."""
    import contextlib

    from ..core.files import write_bytes
    from ..rig import (
        SystemClock,
        brightness,
        encode_png,
        grab_median,
        open_camera,
        photo_flags,
        sharpness,
    )

    clock = SystemClock()
    with contextlib.closing(
        open_camera(table.camera, rig.resolve().parent, clock)
    ) as camera:
        frame = grab_median(camera, clock, frames)
        identity = camera.identity
    level = brightness(frame.image)
    try:
        write_bytes(out, encode_png(frame.image))
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from None
    return {
        "picture": str(out),
        "width_px": frame.image.shape[1],
        "height_px": frame.image.shape[0],
        "brightness": level,
        "sharpness": sharpness(frame.image),
        "flags": photo_flags(
            frame.image, level, level, table.camera.brightness_drift_percent
        ),
        "notes": list(identity.get("notes", ())),
        "camera": identity,
    }
