"""Errors on strangers' benches: scenes drawn at random, none of them tuned on.

    python benchmarks/bench_reserve.py [--count 200] [--seed 9001] [--page DIR]
    python benchmarks/bench_reserve.py --kind blur --count 40 --seed 9111 [--peers]

Seeds below 1000 are for work on the code; quoted figures come from seeds of 9000 and
above that nobody looked at before. Prints, by difficulty: how many were measured,
needless refusals, those wrong without a flag (RMS above 0.15 mm or tip above 0.5 mm),
errors in mm, and the direction's pull in stated deviations; then how many right
ones are doubted. ``--kind`` draws one kind only, and prints it by what was drawn (of
blur: defocus, motion, grain, gloss, exposure; ``--defect`` draws one of these).
Clamps are drawn square to their rods, and that is told; ``--skew-deg 0.25`` draws them
as square, and tells no more, than a clamp of which nothing is told is taken to be.
``--page`` writes a page (index.html) with overlays of the ten worst and of the refused.
``--peers`` measures the same scenes with scikit-image and skan, whose masks are given
to them (`reserve_peers`).
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from reserve_peers import of_peers
from reserve_scenes import DEFECTS, KINDS, Case, draw_case

from magbend.vision import Measurement, draw_overlay, extract, specimen_to_px
from magbend.vision.synthetic import signed_distance

WRONG_RMS_MM, WRONG_TIP_MM = 0.15, 0.5
DOUBTS = {
    "direction_doubtful", "clamp_doubtful", "rough_edges", "ragged_tip", "overexposed",
    "root_hidden", "clamp_at_border", "height_doubtful", "tip_goes_on",
    "clamp_lines_differ", "other_rod", "width_mismatch", "width_uneven",
    "colour_mismatch",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A case and what came of it; errors in mm, NaN where it was refused."""

    case: Case
    found: Measurement
    rms: float = np.nan
    tip: float = np.nan
    length: float = np.nan
    width: float = np.nan
    pull: float = np.nan
    pulls: tuple[float, ...] = ()

    @property
    def wrong(self) -> bool:
        return self.rms > WRONG_RMS_MM or self.tip > WRONG_TIP_MM

    @property
    def doubted(self) -> bool:
        return bool(DOUBTS & set(self.found.flags))

    @property
    def title(self) -> str:
        return f"{self.case.photo.source} {self.case.words}"

    @property
    def told(self) -> str:
        flags = ",".join(self.found.flags)
        if not self.found.ok:
            return f"refused: {self.found.reason} [{flags}]"
        return f"RMS {self.rms:.4f} tip {self.tip:.4f} z {self.pull:+.1f} [{flags}]"

    @property
    def silent(self) -> bool:
        return self.wrong and not self.doubted


def measured(case: Case, skew_deg: float) -> Row:
    found = extract(
        case.photo, case.camera, rod_height_mm=case.height_mm,
        clamp_height_mm=case.scene.clamp.height_mm, is_round=False,
        clamp_square_sd_deg=skew_deg,
    )  # fmt: skip
    if not found.ok or found.pose is None:
        return Row(case=case, found=found)
    line, pose = case.scene.centreline, case.scene.clamp.pose
    points = np.column_stack([found.points["x_mm"], found.points["y_mm"]])
    distance = signed_distance(points, line.points_mm)
    clamp = found.pose.from_board(np.array([[pose.x_mm, pose.y_mm]]))[0]
    off = np.array(found.tip_mm) - line.tip_mm
    turn = (found.pose.angle_deg - pose.angle_deg + 180.0) % 360.0 - 180.0
    return Row(
        case=case, found=found,
        rms=float(np.sqrt(np.mean(distance**2))),
        tip=float(np.hypot(*(np.array(found.tip_mm) - line.tip_mm))),
        length=abs(found.length_mm - line.length_mm),
        width=abs(found.width_mm - case.scene.side_mm),
        pull=turn / found.clamp_angle_sd_deg,
        pulls=(
            (found.length_mm - line.length_mm) / found.length_sd_mm,
            off[0] / found.tip_sd_mm[0],
            off[1] / found.tip_sd_mm[1],
            (found.width_mm - case.scene.side_mm) / found.width_sd_mm,
            clamp[0] / found.clamp_sd_mm,
        ),
    )  # fmt: skip


def table(groups: dict[str, list[Row]]) -> str:
    lines = [
        f"{'kind':10} {'scenes':>6} {'refused':>7} {'wrong':>6} {'silent':>6} "
        f"{'RMS med':>8} {'90 %':>7} {'tip med':>8} {'90 %':>7} {'length':>7} "
        f"{'width':>7} {'z RMS':>6} {'68 %':>5}"
    ]
    for name, some in groups.items():
        good = [row for row in some if row.found.ok]
        head = (
            f"{name:10} {len(some):6} {len(some) - len(good):7} "
            f"{sum(row.wrong for row in good):6} {sum(row.silent for row in good):6} "
        )
        if not good:
            lines.append(head)
            continue
        rms, tip, length, width, pull = (
            np.array([getattr(row, what) for row in good])
            for what in ("rms", "tip", "length", "width", "pull")
        )
        lines.append(
            head + f"{np.median(rms):8.4f} {np.quantile(rms, 0.9):7.4f} "
            f"{np.median(tip):8.4f} {np.quantile(tip, 0.9):7.4f} "
            f"{np.median(length):7.4f} {np.median(width):7.4f} "
            f"{np.sqrt(np.mean(pull**2)):6.2f} {100 * np.mean(np.abs(pull) < 1):4.0f}%"
        )
    return "\n".join(lines)


def grouped(rows: list[Row], kind: str | None) -> dict[str, list[Row]]:
    """Return the rows by kind, or those of one kind by the words for what was drawn."""

    def name_of(row: Row) -> str:
        return row.case.words if kind else row.case.kind

    names = sorted({name_of(row) for row in rows}) if kind else KINDS
    groups = {name: [row for row in rows if name_of(row) == name] for name in names}
    return {**groups, "all": rows}


def doubts(rows: list[Row]) -> str:
    """Return how many of the right measurements are doubted, and by which flags."""
    right = [row for row in rows if row.found.ok and not row.wrong]
    count = Counter(flag for row in right for flag in DOUBTS & set(row.found.flags))
    named = ", ".join(f"{flag} {number}" for flag, number in count.most_common())
    doubted = sum(row.doubted for row in right)
    return f"doubted though right: {doubted} of {len(right)} ({named})"


def coverage(rows: list[Row]) -> str:
    """Return how many errors lie within one stated deviation, of each quantity."""
    pulls = np.array([row.pulls for row in rows if row.found.ok])
    names = ("length", "tip x", "tip y", "width", "clamp place")
    return "\n".join(
        f"{name}: {100 * np.mean(np.abs(pull) < 1):.0f} % within one stated deviation, "
        f"z RMS {np.sqrt(np.mean(pull**2)):.2f}"
        for name, pull in zip(names, pulls.T, strict=True)
    )


def peers_table(rows: list[Row], peers: list[dict[str, tuple[float, float]]]) -> str:
    """Return what ours and peers make of the same scenes; lost ones are wrong."""
    names = ("ours", *peers[0])
    lines = [f"{'kind':10}" + "".join(f"{name:>32}" for name in names)]
    lines.append(f"{'':10}" + len(names) * f"{'RMS mm':>12}{'tip mm':>10}{'wrong':>10}")
    for kind in (*KINDS, "all"):
        chosen = [i for i, row in enumerate(rows) if kind in (row.case.kind, "all")]
        if not chosen:
            continue
        ours = [(rows[i].rms, rows[i].tip) for i in chosen]
        cells = ""
        for name in names:
            errors = np.array(
                ours if name == "ours" else [peers[i][name] for i in chosen]
            )
            errors = np.where(np.isfinite(errors), errors, np.inf)
            wrong = (errors[:, 0] > WRONG_RMS_MM) | (errors[:, 1] > WRONG_TIP_MM)
            rms, tip = np.median(errors, axis=0)
            cells += f"{rms:12.4f}{tip:10.4f}{wrong.sum():7} / {len(chosen)}"
        lines.append(f"{kind:10}{cells}")
    return "\n".join(lines)


def write_page(rows: list[Row], folder: Path) -> None:
    """Write a page of the ten worst and of the refused, true axes as thin red lines."""
    folder.mkdir(parents=True, exist_ok=True)
    refused = [row for row in rows if not row.found.ok]
    worst = sorted((row for row in rows if row.found.ok), key=lambda row: -row.tip)[:10]
    body = ["<h1>The ten worst, and the refused</h1>"]
    for rank, row in enumerate([*worst, *refused]):
        picture = draw_overlay(row.case.photo, row.found, max_side_px=1600)
        pose, line = row.case.scene.clamp.pose, row.case.scene.centreline
        true = specimen_to_px(row.case.camera, pose, line.points_mm)
        corners = np.round(true * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(picture, [corners], False, (0, 0, 255), 1, cv2.LINE_AA, shift=4)
        name = f"{rank:02}_{row.case.photo.source}.png"
        cv2.imwrite(str(folder / name), picture)
        body.append(f'<h2>{row.title}</h2><p>{row.told}</p><img src="{name}">')
    style = "body {font: 16px sans-serif; margin: 2em} img {width: 100%}"
    text = f'<meta charset="utf-8"><title>Worst</title><style>{style}</style>'
    (folder / "index.html").write_text(text + "\n".join(body), encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=9001)
    parser.add_argument("--kind", choices=KINDS, help="this kind of scene only")
    parser.add_argument("--defect", choices=DEFECTS, help="of --kind blur, this alone")
    parser.add_argument("--skew-deg", type=float, default=0.0, help="of clamps, sd")
    parser.add_argument("--page", type=Path, help="folder for overlays")
    parser.add_argument("--peers", action="store_true", help="measure with peers too")
    parser.add_argument("--quiet", action="store_true", help="the table alone")
    options = parser.parse_args()
    rows, peers = [], []
    step = len(KINDS) if options.kind else 1
    first = KINDS.index(options.kind) if options.kind else options.first
    for index in range(first, first + step * options.count, step):
        skew = options.skew_deg
        case = draw_case(options.seed, index, defect=options.defect, skew_deg=skew)
        row = measured(case, skew)
        rows.append(row)
        if options.peers:
            peers.append(of_peers(row.case))
        if not options.quiet:
            print(f"{row.title}: {row.told}")
    print(table(grouped(rows, options.kind)))
    print(coverage(rows))
    print(doubts(rows))
    if peers:
        print(peers_table(rows, peers))
    if options.page is not None:
        write_page(rows, options.page)
    return 1 if any(row.silent for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
