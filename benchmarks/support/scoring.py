"""Estimates against truth: matching and errors, shared by the benchmarks and the tests on photographs."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.results import CircleResult, ImageResult

PHOTOGRAPHS = (
    "discocal_rgb_left",
    "discocal_tir",
    "boofcv_circle_hex_stills",
    "boofcv_movie_hex",
    "boofcv_circle_regular_stills",
    "opencv_circles_a",
    "opencv_circles_c_wide",
    "opencv_acircles",
    "rosi_small_dots",
    "dice_telephoto_donuts",
)


@dataclass(frozen=True, slots=True, eq=False)
class TrueCircle:
    """A circle whose pose is known; `seen_px` and `major_px` of its image where the file gives them."""

    center: FloatArray
    normal: FloatArray
    seen_px: FloatArray | None
    major_px: float | None
    name: str


@dataclass(frozen=True, slots=True)
class Error:
    """Of the better candidate: `range_ratio` is the estimated distance over the true one."""

    position_mm: float
    position_share: float
    normal_deg: float
    range_ratio: float
    chosen: bool


def data_folder() -> Path | None:
    """Return the folder of images with truth: `CIRCLEPOSE_DATA`, or ../shared/data beside the checkout."""
    named = os.environ.get("CIRCLEPOSE_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / ".." / "shared" / "data"
    return folder if folder.is_dir() else None


def read_truth(folder: Path) -> dict[str, list[TrueCircle]]:
    """Read a set's truth.csv; circles by image, in the file's order."""
    truth: dict[str, list[TrueCircle]] = {}
    with (folder / "truth.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            photograph = "u_px" in row
            keys = ("cx", "cy", "cz") if photograph else ("x", "y", "z")
            truth.setdefault(row["image"], []).append(
                TrueCircle(
                    center=np.array([float(row[k]) for k in keys]),
                    normal=np.array([float(row[k]) for k in ("nx", "ny", "nz")]),
                    seen_px=np.array([float(row["u_px"]), float(row["v_px"])]) if photograph else None,
                    major_px=float(row["major_px"]) if photograph else None,
                    name=row.get("circle_id") or row["circle"],
                )
            )
    return truth


def read_radius(folder: Path) -> float:
    """Return the radius that a set's target.json gives, in the set's unit."""
    return float(json.loads((folder / "target.json").read_text())["radius"])


def match(result: ImageResult, truth: list[TrueCircle]) -> list[CircleResult | None]:
    """Return, for each true circle, the estimate seen at its place and of its size, if there is one.

    Truth without an image position is matched by the direction to the centre, within 1 deg.
    """
    found = [c for c in result.circles if c.candidates]
    matched: list[CircleResult | None] = []
    for true in truth:
        best, least = None, np.inf
        for circle in found:
            off = _offset(circle, true)
            if off < least:
                best, least = circle, off
        matched.append(best if least < 1.0 else None)
    return matched


def error(circle: CircleResult, true: TrueCircle) -> Error:
    """Return the error of the candidate whose normal is the nearer to the truth."""
    # A table's digits leave a normal not quite of unit length.
    normal = true.normal / np.linalg.norm(true.normal)
    angles = [float(np.degrees(angle_between(c.normal, normal))) for c in circle.candidates]
    best = int(np.argmin(angles))
    distance = float(np.linalg.norm(true.center))
    position = float(np.linalg.norm(circle.candidates[best].center - true.center))
    ratio = float(np.linalg.norm(circle.candidates[best].center)) / distance
    return Error(position, position / distance, float(angles[best]), ratio, best == circle.chosen)


def _offset(circle: CircleResult, true: TrueCircle) -> float:
    """Distance of an estimate from a true circle, 1 at the limit of what counts as the same."""
    if true.seen_px is not None and true.major_px is not None:
        assert circle.ellipse is not None
        if abs(2.0 * float(circle.ellipse.semi_major) / true.major_px - 1.0) > 0.25:
            return np.inf
        return float(np.linalg.norm(circle.ellipse.center - true.seen_px)) / (0.1 * true.major_px + 1.0)
    sight = true.center / np.linalg.norm(true.center)
    directions = [c.center / np.linalg.norm(c.center) for c in circle.candidates]
    return min(float(np.degrees(angle_between(d, sight))) for d in directions)
