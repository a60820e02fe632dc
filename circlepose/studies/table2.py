"""Tables 1 and 2 of Fu & Zhou done again: concentric circles, coplanar and coaxial, at their calibrated poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from circlepose.pipeline import estimate
from circlepose.results import CircleResult
from circlepose.studies.nearness import angle_deg, triple
from circlepose.studies.published import TABLES_1_AND_2, PrintedCandidate, PrintedScene, Triple
from circlepose.studies.scenes import COAXIAL_TARGET, COPLANAR_TARGET, coaxial_scenes, coplanar_scenes
from circlepose.synthesis.render import render

Source = Literal["circlepose", "print, measured", "print, calibrated"]


@dataclass(frozen=True, slots=True)
class Table2Row:
    """One pose of a scene's largest circle; a field is None where there is nothing to say."""

    scene: str
    """1a to 1d of Table 1 (coplanar), 2a and 2b of Table 2 (coaxial)"""
    source: Source
    candidate: Literal["chosen", "other"] | None
    normal: Triple | None
    """UN, towards the camera: the printed ones are turned round"""
    center_mm: Triple | None
    """TV"""
    generatrix_mm: float | None
    """GCC"""
    center_error_mm: Triple | None = None
    """Error(TV): the components of TV less the calibrated one's, without signs as in Table 1"""
    position_error_mm: float | None = None
    """their length; the calibrated pose is the exact truth of the rendered scene"""
    orientation_error_deg: float | None = None


def table2_rows(scenes: Sequence[str] | None = None) -> tuple[Table2Row, ...]:
    """Return the rows of both tables for `scenes` (default: all six), measured and printed.

    Raises nothing: a scene in which the target is not found has a row without a pose.
    """
    rendered = {
        **{f"1{scene.name}": (scene, COPLANAR_TARGET) for scene in coplanar_scenes()},
        **{f"2{scene.name}": (scene, COAXIAL_TARGET) for scene in coaxial_scenes()},
    }
    rows: list[Table2Row] = []
    for printed in TABLES_1_AND_2:
        if scenes is None or printed.scene in scenes:
            scene, target = rendered[printed.scene]
            circles = estimate(render(scene), scene.camera, target).circles
            rows += _measured_rows(printed, circles[0] if circles else None)
            rows += _printed_rows(printed)
    return tuple(rows)


def _measured_rows(printed: PrintedScene, circle: CircleResult | None) -> Iterator[Table2Row]:
    if circle is None or not circle.candidates:
        yield Table2Row(printed.scene, "circlepose", None, None, None, None)
        return
    order = sorted(range(len(circle.candidates)), key=lambda number: number != circle.chosen)
    for number in order:
        candidate = circle.candidates[number]
        yield Table2Row(
            printed.scene,
            "circlepose",
            "chosen" if number == circle.chosen else "other",
            triple(candidate.normal),
            triple(candidate.center),
            candidate.generatrix_mm,
            *_errors(triple(candidate.normal), triple(candidate.center), printed.calibrated),
        )


def _printed_rows(printed: PrintedScene) -> Iterator[Table2Row]:
    for number, pose in enumerate(printed.measured):
        normal = _towards_camera(pose)
        errors = _errors(normal, pose.center_mm, printed.calibrated)
        which: Literal["chosen", "other"] = "chosen" if number == 0 else "other"
        yield Table2Row(printed.scene, "print, measured", which, normal, pose.center_mm, pose.generatrix_mm, *errors)
    truth = printed.calibrated
    yield Table2Row(
        printed.scene, "print, calibrated", None, _towards_camera(truth), truth.center_mm, truth.generatrix_mm
    )


def _errors(normal: Triple, center_mm: Triple, calibrated: PrintedCandidate) -> tuple[Triple, float, float]:
    error = np.array(center_mm) - np.array(calibrated.center_mm)
    turned = float(angle_deg(np.array(normal), np.array(_towards_camera(calibrated))))
    return triple(np.abs(error)), float(np.linalg.norm(error)), turned


def _towards_camera(pose: PrintedCandidate) -> Triple:
    x, y, z = pose.normal
    return -x, -y, -z
