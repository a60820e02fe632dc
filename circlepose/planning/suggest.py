"""The board that measures best: of all that fit a sheet of paper and a camera's view, by what is predicted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from circlepose.camera.camera import EXACT, Camera
from circlepose.errors import UsageError
from circlepose.planning.predict import Prediction, predict
from circlepose.planning.search import place_px
from circlepose.planning.views import USUAL, Look, View
from circlepose.targets.board import BoardLayout, Grid
from circlepose.targets.target import Target

_RADII_PX = (6.0, 8.0, 11.0, 15.0, 21.0, 30.0)
"""Radii, in the image at the farthest distance, that are tried; smaller ones are hardly found when tilted."""
_SPACINGS = (3.0, 3.5, 4.0)
"""Distances of neighbors, in radii, that are tried; closer ones are found less often, see the page on printing."""
MOST_PROPOSALS = len(_RADII_PX) * len(_SPACINGS)
_TILT_DEG = 35.0
_LEAST, _MOST = 4, 600
"""Circles of a board: with fewer it is hardly placed where some are hidden, with more it takes long."""
_LARGEST_SHARE = 0.9
"""Of the image, that the board may fill at the nearest distance."""
_AS_GOOD = 1.05
"""Ratio of errors up to which larger circles are preferred: they bear more blur and dirt."""
_STEP_MM = 0.5
"""To which radius and spacing are rounded."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A board that fits, and what is predicted of it at the farthest distance, tilted."""

    target: Target
    prediction: Prediction

    @property
    def error(self) -> float:
        """Geometric mean of the standard deviations of position (mm) and normal (deg); infinite without these."""
        position, normal = self.prediction.position_mm, self.prediction.sigma_normal_deg
        if position is None or normal is None or self.prediction.found < 1.0:
            return math.inf
        return math.sqrt(position * normal)


def proposals(
    camera: Camera, range_mm: tuple[float, float], field_mm: tuple[float, float], look: Look = USUAL
) -> Iterator[Proposal]:
    """Yield boards, each with its prediction.

    Parameters
    ----------
    camera
        With its image size.
    range_mm
        The nearest and the farthest distance.
    field_mm
        Width and height that the circles may cover.
    look
        Noise, blur and contrast.

    Raises
    ------
    UsageError
        Where no board of four circles fits.
    """
    boards = list(_boards(camera, range_mm, field_mm))
    if not boards:
        raise UsageError(
            "--suggest: no board of four circles fits: they would be too large for the paper, or for the image at "
            "the nearest distance; give larger paper, or nearer distances."
        )
    view = View(range_mm[1], _TILT_DEG, place_px(camera, "middle"))
    # Its errors are the same for all boards.
    exact = replace(camera, sigma=EXACT)
    for target in boards:
        yield Proposal(target, predict(exact, target, view, look, pairs=1))


def best_of(tried: Sequence[Proposal]) -> Proposal:
    """Return the board of the least error; of those nearly as good the one of the largest circles."""
    least = min(each.error for each in tried)
    if math.isinf(least):
        raise UsageError("--suggest: no board is found at the farthest distance; take a longer lens or come nearer.")
    return max((each for each in tried if each.error <= _AS_GOOD * least), key=lambda each: each.target.radii_mm[0])


def _boards(camera: Camera, range_mm: tuple[float, float], field_mm: tuple[float, float]) -> Iterator[Target]:
    assert camera.image_size is not None
    nearest, farthest = range_mm
    focal_px = math.sqrt(float(camera.camera_matrix[0, 0] * camera.camera_matrix[1, 1]))
    in_view = sorted(_LARGEST_SHARE * size * nearest / focal_px for size in camera.image_size)
    # The long side of the board along the long side of the image.
    width, height = (min(own, seen) for own, seen in zip(sorted(field_mm), in_view, strict=True))
    if field_mm[0] > field_mm[1]:
        width, height = height, width
    seen: set[tuple[float, float]] = set()
    for radius_px in _RADII_PX:
        radius = _rounded(radius_px * farthest / focal_px)
        for ratio in _SPACINGS:
            spacing = _rounded(ratio * radius)
            columns = int((width - 2.0 * radius) // spacing) + 1
            rows = int((height - 2.0 * radius) // spacing) + 1
            is_new = (radius, spacing) not in seen
            seen.add((radius, spacing))
            if is_new and min(rows, columns) >= 2 and _LEAST <= rows * columns <= _MOST:
                yield Target.board(BoardLayout.on_grid(radius, Grid("symmetric", rows, columns, spacing)))


def _rounded(length_mm: float) -> float:
    """Return a length up to the next half of a millimeter, or of a tenth where it is small."""
    step = _STEP_MM if length_mm > 2.0 else 0.1 * _STEP_MM
    return round(math.ceil(length_mm / step - 1e-9) * step, 3)


def why(best: Proposal, tried: Sequence[Proposal], range_mm: tuple[float, float]) -> Iterator[str]:
    """Yield in sentences what was chosen, and what it was compared with."""
    layout = best.target.layout
    assert layout is not None
    assert layout.grid is not None
    grid, predicted = layout.grid, best.prediction
    assert predicted.position_mm is not None
    radius, farthest = best.target.radii_mm[0], range_mm[1]
    size = f"circles of radius {radius:g} mm, {grid.spacing_mm:g} mm apart"
    accuracy = f"{predicted.position_mm:.2g} mm and {predicted.sigma_normal_deg:.2g} deg"
    yield (
        f"{grid.rows} x {grid.columns} {size}: at {farthest:g} mm, tilted {_TILT_DEG:g} deg, {accuracy} by the "
        "image's noise; circlepose plan has the camera's errors, too"
    )
    worst = max((each for each in tried if math.isfinite(each.error)), key=lambda each: each.error)
    other = worst.target.layout
    assert other is not None
    assert other.grid is not None
    yield (
        f"of {len(tried)} boards that fit it measures best, or hardly less well with larger circles; the least good, "
        f"{other.grid.rows} x {other.grid.columns} of radius {worst.target.radii_mm[0]:g} mm, has errors "
        f"{worst.error / best.error:.1f} times as large"
    )
