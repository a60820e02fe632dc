"""Fig. 9 of Fu & Zhou done again over many rendered scenes: how far the generatrix of each pair is from the part's.

Each scene has a conical boss or recess with the part's radii and generatrix (`GENERATRIX_MM`), at a pose drawn at
random. Both candidates are measured by `estimate`. GCC is their `generatrix_mm`: that of the circles' own poses, at
the end of the diameters that is nearer to the camera. In print the right pair's deviates by less than 1 mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import plane_basis
from circlepose.pipeline import estimate
from circlepose.studies.nearness import angle_deg, nearest
from circlepose.studies.published import GENERATRIX_MM, TABLES_1_AND_2
from circlepose.studies.scenes import COAXIAL_TARGET, coaxial_part_scene, fu_zhou_camera
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Scene

Part = Literal["boss", "recess"]
PARTS: tuple[Part, ...] = ("boss", "recess")
SCENES = 30
"""of each part"""
PRINTED_LIMIT_MM = 1.0
"""'the deviation between the correct GCC and the calibrated GCC is less than 1 mm over different scenes'"""
_BANDS = ((5.0, 15.0), (15.0, 30.0), (30.0, 45.0))
"""tilts, deg: below 5 the candidates nearly coincide, above 45 little of a recess' floor is in sight"""
_DISTANCE_MM = (600.0, 850.0)
_MARGIN_PX = 220.0
"""between the imaged center and the image's border, so that all of the part is in the image"""


@dataclass(frozen=True, slots=True)
class GccPoint:
    """One scene: GCC less the part's, mm; None where there is no such pair."""

    part: str
    tilt_deg: float
    """of the normal from the line of sight"""
    right_mm: float | None
    """of the pair that has the true pose"""
    other_mm: float | None
    chosen_right: bool | None = None
    """whether `estimate` chose the right candidate"""


@dataclass(frozen=True, slots=True)
class GccRow:
    """The deviations of the scenes of one part in one band of tilts."""

    part: str
    tilts: str
    """deg; for what is printed the scene"""
    scenes: int
    no_pose: int | None
    median_mm: float | None
    """of the right pair's absolute deviation"""
    most_mm: float | None
    least_other_mm: float | None
    """the least absolute deviation of the other pair"""
    gcc_right: int | None
    """scenes in which the right pair's deviation is the smaller one"""
    chosen_right: int | None
    """scenes in which `estimate` chose the right candidate"""


def printed_points() -> tuple[GccPoint, ...]:
    """Return the two scenes of Table 2; there the deviation is to the calibrated GCC of the scene."""
    points = []
    for scene in TABLES_1_AND_2:
        known = scene.calibrated.generatrix_mm
        lengths = [pose.generatrix_mm for pose in scene.measured]
        if known is not None and len(lengths) == 2 and lengths[0] is not None and lengths[1] is not None:
            tilt = angle_deg(np.array(scene.calibrated.normal), np.array(scene.calibrated.center_mm))
            points.append(GccPoint(f"print, {scene.scene}", float(tilt), lengths[0] - known, lengths[1] - known))
    return tuple(points)


def gcc_points(scenes: int = SCENES, seed: int = 0) -> Iterator[GccPoint]:
    """Yield a point per rendered scene, `scenes` of each part; tilts are spread evenly over the bands.

    Raises `ArgumentError` for less than one scene.
    """
    if scenes < 1:
        raise ArgumentError(f"scenes: expected at least 1, got {scenes}.")
    for (kind, part), number in product(enumerate(PARTS), range(scenes)):
        generator = np.random.Generator(np.random.PCG64([seed, kind, number]))
        low, high = _BANDS[number % len(_BANDS)]
        yield measured(gcc_scene(part, generator.uniform(low, high), generator))


def gcc_scene(part: Part, tilt_deg: float, generator: np.random.Generator) -> Scene:
    """Return a scene with the `part` at a place, distance and direction of the tilt drawn at random."""
    camera = fu_zhou_camera()
    width, height = camera.image_size or (0, 0)
    pixel = generator.uniform([_MARGIN_PX, _MARGIN_PX], [width - _MARGIN_PX, height - _MARGIN_PX])
    sight = camera.rays(pixel)
    sight = sight / np.linalg.norm(sight)
    lean, tilt = generator.uniform(0.0, 2.0 * math.pi), math.radians(tilt_deg)
    e1, e2 = plane_basis(sight)
    normal = math.sin(tilt) * (math.cos(lean) * e1 + math.sin(lean) * e2) - math.cos(tilt) * sight
    return coaxial_part_scene(part, generator.uniform(*_DISTANCE_MM) * sight, normal, int(generator.integers(2**31)))


def measured(scene: Scene) -> GccPoint:
    """Return what `estimate` finds in a scene with one part."""
    (part,) = scene.targets
    if not isinstance(part, CoaxialPart):
        raise ArgumentError(f"scene: expected a boss or a recess, got a target of kind {part.kind}.")
    tilt = float(angle_deg(-part.normal, part.center_mm))
    circles = estimate(render(scene), scene.camera, COAXIAL_TARGET).circles
    big = next((circle for circle in circles if circle.circle == "big" and circle.candidates), None)
    if big is None:
        return GccPoint(part.form, tilt, None, None)
    right = nearest(np.array([candidate.normal for candidate in big.candidates]), part.normal)
    deviations = [
        None if candidate.generatrix_mm is None else candidate.generatrix_mm - GENERATRIX_MM
        for candidate in big.candidates
    ]
    other = deviations[1 - right] if len(deviations) == 2 else None
    return GccPoint(part.form, tilt, deviations[right], other, chosen_right=big.chosen == right)


def gcc_rows(points: Sequence[GccPoint]) -> tuple[GccRow, ...]:
    """Return a row per printed scene, and per part and band of tilts."""
    printed = [_row(point.part, f"{point.tilt_deg:.0f}", [point]) for point in points if point.part not in PARTS]
    rows = []
    for part, (low, high) in product(PARTS, _BANDS):
        among = [point for point in points if point.part == part and low <= point.tilt_deg < high]
        if among:
            rows.append(_row(part, f"{low:.0f} to {high:.0f}", among))
    return (*printed, *rows)


def _row(part: str, tilts: str, points: Sequence[GccPoint]) -> GccRow:
    right = _magnitudes([point.right_mm for point in points])
    other = _magnitudes([point.other_mm for point in points])
    chosen = [point.chosen_right for point in points if point.chosen_right is not None]
    return GccRow(
        part,
        tilts,
        scenes=len(points),
        no_pose=len(points) - len(right),
        median_mm=float(np.median(right)) if len(right) else None,
        most_mm=float(right.max()) if len(right) else None,
        least_other_mm=float(other.min()) if len(other) else None,
        gcc_right=sum(
            abs(point.right_mm) < abs(point.other_mm)
            for point in points
            if point.right_mm is not None and point.other_mm is not None
        ),
        chosen_right=sum(chosen) if chosen else None,
    )


def _magnitudes(values: Sequence[float | None]) -> FloatArray:
    return np.abs(np.array([value for value in values if value is not None], dtype=np.float64))
