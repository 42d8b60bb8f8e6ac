"""Commented rig, plan and specimen files to begin with."""

from __future__ import annotations

from pathlib import Path

from ...core.errors import StoreError
from ...core.files import write_text

RIG = """\
# The bench: what stands on it and what it may do. Lengths in mm, flux in mT.
# Check it without moving anything:  magbend rig run plan.toml --dry-run
name = "bench"

[bench]
# Which way is up, in the specimen frame: x along the undeformed rod, z to the camera.
# It counts where the specimen has a density_kg_m3. A camera above: 0, 0, 1.
up = [0.0, 0.0, 1.0]

[stage]
driver = "grbl"            # grbl (also grblHAL, FluidNC) or marlin
{port}# auto, /dev/ttyUSB0, COM3, or serial:NUMBER of the USB chip
axis = "X"
# The gap is the distance from the magnet's N face to the rod's undeformed tip:
#     gap_mm = gap_at_zero_mm + direction * machine_mm
# magbend rig set-gap measures both with you and writes them here. Until then the stage
# can be homed and jogged, and nothing else.
{zero}direction = 1              # 1: the gap grows with the machine position, else -1
feed_mm_min = 300.0
backlash_mm = 0.5          # every gap is approached from this much farther away
homing = "switches"        # or "manual": you give the gap with --assume-gap-mm
# What the controller must be set to; another value is refused on connecting.
# steps_per_mm = 250.0
# travel_mm = 200.0

[limits]
min_gap_mm = 40.0          # interlock: nothing nearer is ever sent to the stage
max_gap_mm = 149.0

[camera]
{camera}# auto, opencv, mjpeg, folder, video, twin
source = 0                 # device number, http://... stream, folder or video file
# exposure = 100.0         # locked, read back, and proved by the brightness
# gain = 0.0
# focus = 30.0             # locked with autofocus off; magbend rig snapshot shows it
frame_timeout_s = 5.0

[meter]
{meter}# manual, none, twin, or one of
#   {meters}
# port = "/dev/ttyUSB1"
# zero_mT = 0.0            # reading in zero field, taken off every reading

[magnet]                   # the cube of the paper
side_mm = 55.0
remanence_T = 1.305        # magbend rig scan-field plan.toml measures yours
"""

PLAN = """\
# One run: this rod, at these gaps, from far to near.
name = "gmc2"
operator = ""
specimen = "specimen.toml"
rig = "rig.toml"
gaps_mm = [70.0, 60.0, 50.0]

[settle]                   # when is the rod still?
time_s = 2.0               # wait this long in any case
image_change_percent = 0.02  # then: no more pixels than these change ...
frames = 5                 # ... over so many pictures
timeout_s = 30.0           # after this the step is flagged, not lost

[photograph]
frames = 3                 # pixel-wise median of so many

[flux]
samples = 5

[abort]
policy = "hold"            # or "retract": away from the magnet
"""

SPECIMEN = """\
# GMC 2 of the paper: three sections, the softest at the tip.
name = "GMC 2"
side_mm = 1.0              # square cross-section
remanence_mT = 20.07       # along the rod; + points root to tip
# density_kg_m3 = 2640     # with it weight counts, as [bench] of the rig file says

[[section]]                # root first
length_mm = 10.0
E_MPa = 20.0

[[section]]
length_mm = 10.0
E_MPa = 15.0

[[section]]
length_mm = 10.0
E_MPa = 10.0
"""


def _row(key: str, value: str) -> str:
    """Return a row of TOML, padded so that the comments stand below each other."""
    return f'{key} = "{value}"'.ljust(27)


def is_bench(folder: Path) -> bool:
    """Return whether a folder holds rig and plan, as `write_templates` leaves it."""
    return all((folder / name).is_file() for name in ("rig.toml", "plan.toml"))


def write_templates(folder: Path, *, twin: bool = False) -> tuple[Path, ...]:
    """Write ``rig.toml``, ``plan.toml`` and ``specimen.toml``; overwrite nothing.

    Parameters
    ----------
    folder : Path
        Where to; made if missing.
    twin : bool
        Name the twin's camera and meter instead of real ones.

    Raises
    ------
    StoreError
        If one of the files is there already, or the folder cannot be written.
    """
    from ..meter.description import ready_meters

    rig = RIG.format(
        zero="gap_at_zero_mm = 150.0     # of the computed bench\n" if twin else "",
        port=_row("port", "twin://board.json" if twin else "auto"),
        camera=_row("backend", "twin" if twin else "auto"),
        meter=_row("driver", "twin" if twin else "manual"),
        meters=", ".join(ready_meters()),
    )
    texts = {"rig.toml": rig, "plan.toml": PLAN, "specimen.toml": SPECIMEN}
    for name in texts:
        if (folder / name).exists():
            raise StoreError(
                f"{folder / name}: is there already and is not overwritten; name "
                f"another folder"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            write_text(folder / name, text)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error.strerror}") from None
    return tuple(folder / name for name in texts)
