"""What ``magbend vision`` prints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .console import print_json, say

if TYPE_CHECKING:
    from ..vision import BatchResult, Calibration, FrameRow, Ringing, TagPlace


def calibration_facts(result: Calibration) -> dict[str, Any]:
    """Return what is worth knowing of a calibration, for `--json` and for people."""
    return {
        "mm_per_px": result.mm_per_px(result.centre_px, height_mm=0.0),
        "scale_relative_sd": result.scale_relative_sd,
        "rms_px": result.rms_px,
        "tilt_deg": result.tilt_deg,
        "focal_px": result.focal_px[0],
        "distortion": result.distortion,
        "camera_height_mm": result.camera_height_mm,
        "camera_height_sd_mm": result.camera_height_sd_mm,
        "camera_height_source": result.camera_height_source,
        "rod_height_mm": result.rod_height_mm,
        "views": [
            {
                "name": view.name,
                "rms_px": view.rms_px,
                "corners": view.corners,
                "used": view.used,
                "why_not": view.why_not,
            }
            for view in result.views
        ],
    }


def _known(value: float, sd: float) -> str:
    """Return both to the second digit of the deviation, which is never told as 0."""
    places = max(0, 1 - math.floor(math.log10(sd))) if 0.0 < sd < math.inf else 3
    return f"{value:.{places}f} +- {sd:.{places}f}"


def tell_calibration(result: Calibration, facts: dict[str, Any], out: Path) -> None:
    """Print a calibration for people."""
    for view in result.views:
        verdict = "used" if view.used else f"dropped: {view.why_not}"
        say(f"{view.name}: {view.corners} corners, RMS {view.rms_px:.3f} px, {verdict}")
    say(f"scale {facts['mm_per_px']:.7f} mm/px, tilt {result.tilt_deg:.2f} deg")
    if math.isfinite(result.camera_height_sd_mm):
        height, sd = result.camera_height_mm, result.camera_height_sd_mm
        say(
            f"camera {_known(height, sd)} mm above the plane "
            f"({result.camera_height_source}); per mm of height the scale shrinks by "
            f"{_known(100.0 / height, 100.0 * sd / height**2)} %"
        )
        if sd > 0.3 * height:
            say(
                "The camera's height is hardly known. If the rod lies above the "
                "board's plane, give --camera-height-mm or add tilted photographs."
            )
    else:
        say(f"camera height {result.camera_height_source}")
    say(f"{out}: written")


_TOLD_ONCE = ("uncalibrated", "clamp_moved", "height_assumed")

_EXPLAINED = {
    "uncalibrated": "no calibration was given, so there are pixels and no mm: "
    "photograph the board (magbend vision board), or a ruler, then magbend vision "
    "calibrate, and give its file as --calibration",
    "height_assumed": "nobody said how high the rod's axis lies above the board; 0 mm "
    "is taken: give --rod-height-mm (half the rod's side, and what lies under it), 0 "
    "if the board lay at its height",
    "height_doubtful": "how far the camera is from the plane is hardly known, and the "
    "scale at the rod's height with it: calibrate with --camera-height-mm (2 % is "
    "enough) or with photographs of the tilted board",
    "camera_moved": "the tag on the clamp is seen in another size than when it was "
    "registered: the camera was moved or focused anew since; calibrate again",
    "clamp_turned": "the tag on the clamp lies in another direction than when it was "
    "registered: the camera or the clamp was turned since, or the pictures were",
    "length_differs": "the rod is not as long there as in the other photographs of "
    "its run: the camera was moved or tilted since it was calibrated, or the rod "
    "slipped in its clamp",
    "length_mismatch": "the rod is not as long as it should be: another rod, another "
    "free length, a wrong --rod-height-mm, or a camera that was moved since it was "
    "calibrated",
    "width_mismatch": "the rod is not as wide as its specimen: another rod, or a hard "
    "shade was measured with it",
    "width_uneven": "the rod is not as wide all along: it tapers or swells, or a shade "
    "as dark as itself is measured with it where they lie side by side; light it from "
    "more sides, and look at the overlay",
    "colour_mismatch": "what was measured has another colour than the specimen: its "
    "shade, or another thing; look at the overlay",
    "tag_differs": "the tag and the rod itself tell different clamps: the tag came "
    "loose, the rod was clamped anew, or the clamp's line is that of a shade",
    "tag_not_seen": "the calibration knows a tag on the clamp, and it is not seen; "
    "the rod itself tells place and direction",
    "clamp_at_border": "the rod is measured from the border of the picture, not from "
    "its clamp: arc lengths begin there",
    "clamp_lines_differ": "the lines at the clamp tell different places, or its front "
    "is not square to the rod: look where the overlay begins, and light the clamp's "
    "front evenly",
    "clamp_doubtful": "a dark line goes on behind the point taken for the root, or the "
    "clamp's front and its shade are seen as one: look where the overlay begins",
    "direction_doubtful": "the direction at the clamp is so unsure that the tip may be "
    "off by more than 0.15 mm: softer light there helps, and a tag on the clamp most "
    "(vision board --clamp-tag)",
    "root_hidden": "the clamp's top may hide the root: give --clamp-height-mm or "
    "--length-mm",
    "overexposed": "white along the rod hides where its edges are: expose less",
    "rough_edges": "the edges scatter: hairs, or things that touch the rod; look at "
    "the overlay",
    "ragged_tip": "the end is no flat face: it is frayed, or something lies there; "
    "look at the overlay",
    "tip_goes_on": "something as wide as the rod, but paler, goes on beyond its tip: "
    "its shade, or a part of it in another colour; look at the overlay",
    "other_rod": "something else in the picture may be the rod, or the rest of it: "
    "cover it, or say --specimen",
}
"""Flags that a sentence helps with."""

_BY_HAND = (
    "A rod that is seen in a photograph that failed can be pointed at: magbend vision "
    "points PHOTO --clamp X,Y --tip X,Y"
)


def _tell_clamps(frames: Sequence[FrameRow]) -> None:
    """Say which photographs share a clamp, and which should and do not."""
    shared = {frame.shared_clamp: frame.clamp_angle_sd_deg for frame in frames}
    for run, sd_deg in shared.items():
        if run:
            count = sum(frame.shared_clamp == run for frame in frames)
            say(
                f"{run}: {count} photographs share one clamp, its direction is known "
                f"to {sd_deg:.2f} deg"
            )
    moved = sum("clamp_moved" in frame.flags for frame in frames)
    if moved:
        say(
            f"clamp_moved: {moved} photographs of one clamp disagree on its place or "
            "direction; each keeps its own: if neither camera nor clamp was moved, "
            "light its front evenly, or put a tag on it (vision board --clamp-tag)",
            err=True,
        )


def _tell_doubts(frames: Sequence[FrameRow]) -> None:
    """Say what is doubted, once for photographs in a row (of a film, hundreds)."""
    for words, row in groupby(frames, key=_doubts):
        if not words:
            continue
        names = [frame.image for frame in row]
        if len(names) > 2:
            names = [f"{names[0]} to {names[-1]} ({len(names)})"]
        for name in names:
            say(f"{name}: {words}", err=True)


def _doubts(frame: FrameRow) -> str:
    if not frame.ok:
        return f"failed: {frame.reason}"
    return ", ".join(flag for flag in frame.flags if flag not in _TOLD_ONCE)


def tell_frames(result: BatchResult, *, json_output: bool) -> None:
    """Print what came of the photographs: their doubts, and how many were measured."""
    if json_output:
        print_json(
            {
                "out": str(result.out),
                "measured": result.measured,
                "failed": len(result.frames) - result.measured,
                "frames": [
                    {
                        "image": frame.image,
                        "status": frame.status,
                        "flags": frame.flags,
                        "length_mm": frame.length_mm,
                        "tip_mm": frame.tip_mm,
                        "tip_angle_deg": frame.tip_angle_deg,
                        "width_mm": frame.width_mm,
                        "length_sd_mm": frame.length_sd_mm,
                        "tip_sd_mm": frame.tip_sd_mm,
                        "width_sd_mm": frame.width_sd_mm,
                        "clamp_sd_mm": frame.clamp_sd_mm,
                        "clamp_angle_sd_deg": frame.clamp_angle_sd_deg,
                        "shared_clamp": frame.shared_clamp,
                        "reason": frame.reason,
                    }
                    for frame in result.frames
                ],
            }
        )
        return
    _tell_doubts(result.frames)
    _tell_clamps(result.frames)
    for flag, words in _EXPLAINED.items():
        count = sum(flag in frame.flags for frame in result.frames)
        if count:
            many = "s" if count > 1 else ""
            say(f"{flag} ({count} photograph{many}): {words}", err=True)
    if result.measured < len(result.frames):
        say(_BY_HAND, err=True)
    say(f"{result.out}: {result.measured} of {len(result.frames)} photographs measured")


def tell_ringing(found: Ringing, settle_mm: float) -> None:
    """Print a vibration for people."""
    say(
        f"frequency {_known(found.frequency_Hz, found.frequency_sd_Hz)} Hz, "
        f"damping ratio {_known(found.damping_ratio, found.damping_ratio_sd)}"
    )
    settled = (
        f"below {settle_mm:g} mm {_known(found.settle_s, found.settle_sd_s)} s later"
        if math.isfinite(found.settle_s)
        else "it does not die away"
    )
    say(
        f"amplitude {found.amplitude_mm:.3f} mm at {found.first_s:.3f} s; {settled} "
        f"({found.frames} frames, {found.residual_mm:.3f} mm left)"
    )


def tell_tag(placed: TagPlace, out: Path) -> None:
    """Print where the rod leaves the clamp, seen from its tag, for people."""
    for image, why in placed.left_out.items():
        say(f"{image}: left out: {why}", err=True)
    tag, count = placed.tag, len(placed.used)
    upward = f"{abs(tag.root_x_mm):.3f} mm {'above' if tag.root_x_mm > 0 else 'below'}"
    aside = f"{abs(tag.root_y_mm):.3f} mm {'left' if tag.root_y_mm > 0 else 'right'}"
    say(
        f"tag {tag.number}: the rod leaves the clamp {upward} and "
        f"{aside} of its middle, as printed, known to "
        f"{tag.place_sd_mm:.3f} mm along the rod; its direction is "
        f"{_known(tag.angle_deg, tag.angle_sd_deg)} deg from the tag's upward "
        f"({count} photograph{'s' if count > 1 else ''})"
    )
    say(f"{out}: written")
