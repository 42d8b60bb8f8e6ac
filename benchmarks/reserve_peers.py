"""What peers make of strangers' benches: scikit-image's skeleton, skan's longest path.

They have no rule for clamp, tip or camera. So they are given what they lack: the rod's
own piece of the mask, cut off at the clamp's true face; our calibration; and the true
place and direction of the clamp. What is left are errors of the line itself.
"""

from __future__ import annotations

import cv2
import numpy as np
from bench_vision_peers import longest_path
from reserve_scenes import Case
from skimage.morphology import skeletonize

from magbend.vision.synthetic import signed_distance

MASKS = ("perfect mask", "Otsu's mask")
LOST = (np.inf, np.inf)


def of_peers(case: Case) -> dict[str, tuple[float, float]]:
    """Return RMS distance of the path and distance of its end, mm, by mask."""
    true = true_mask(case)
    masks = dict(zip(MASKS, (true, otsu_mask(case, true)), strict=True))
    return {name: errors(case, mask) for name, mask in masks.items()}


def true_mask(case: Case) -> np.ndarray:
    """Return the rod's silhouette: its outline at every height, top to bottom."""
    scene, pose = case.scene, case.scene.clamp.pose
    line = scene.centreline
    left = np.column_stack([-np.sin(line.theta_rad), np.cos(line.theta_rad)])
    sides = [line.points_mm + k * 0.5 * scene.side_mm * left for k in (1.0, -1.0)]
    outline = pose.to_board(np.vstack([sides[0], sides[1][::-1]]))
    mask = np.zeros(case.photo.grey.shape, np.uint8)
    for height in pose.height_mm + scene.side_mm * np.linspace(-0.5, 0.5, 5):
        seen = case.camera.to_px(outline, height_mm=height)
        corners = np.round(16.0 * seen).astype(np.int32).reshape(-1, 1, 2)
        cv2.fillPoly(mask, [corners], 1, shift=4)
    return mask.astype(bool)


def otsu_mask(case: Case, true: np.ndarray) -> np.ndarray:
    """Return the piece of Otsu's mask that holds most of the rod, without the clamp."""
    grey = np.round(255.0 * np.sqrt(np.clip(case.photo.grey, 0.0, 1.0))).astype(
        np.uint8
    )
    _, over = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    around = cv2.dilate(true.astype(np.uint8), np.ones((31, 31), np.uint8)) > true
    is_dark = np.median(grey[true]) < np.median(grey[around])
    mask = (over == (0 if is_dark else 1)).astype(np.uint8)
    mask[behind_clamp(case)] = 0
    _, labels = cv2.connectedComponents(mask)
    held = np.bincount(labels[true], minlength=2)
    held[0] = 0
    return labels == int(np.argmax(held)) if held.any() else np.zeros_like(true)


def behind_clamp(case: Case) -> np.ndarray:
    """Return the pixels behind the clamp's front, over its whole width."""
    clamp = case.scene.clamp
    half, far = 0.5 * clamp.width_mm + 1.0, clamp.length_mm
    corners = np.array([[0.0, half], [0.0, -half], [-far, -half], [-far, half]])
    on_board = clamp.pose.to_board(corners)
    seen = case.camera.to_px(on_board, height_mm=clamp.pose.height_mm)
    mask = np.zeros(case.photo.grey.shape, np.uint8)
    cv2.fillPoly(mask, [np.round(seen).astype(np.int32).reshape(-1, 1, 2)], 1)
    return mask.astype(bool)


def errors(case: Case, mask: np.ndarray) -> tuple[float, float]:
    """Return RMS and tip's distance of the longest path, mm; infinite without one."""
    rows, columns = np.nonzero(mask)
    if len(rows) < 50:
        return LOST
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    skeleton = skeletonize(np.pad(mask[box], 2))
    if np.count_nonzero(skeleton) < 10:
        return LOST
    corner = np.array([columns.min() - 2, rows.min() - 2])
    path = (longest_path(skeleton) + corner).astype(float)
    pose, line = case.scene.clamp.pose, case.scene.centreline
    at = pose.from_board(case.camera.to_mm(path, height_mm=pose.height_mm))
    away = signed_distance(at, line.points_mm)
    ends = np.hypot(*(at[[0, -1]] - line.tip_mm).T)
    return float(np.sqrt(np.mean(away**2))), float(ends.min())
