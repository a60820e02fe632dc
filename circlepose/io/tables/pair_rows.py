"""Results as rows of the layout `pairs`: distance and angle of each two circles of an image."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping

from circlepose.io.tables.columns import Row
from circlepose.results import CircleResult, ImageResult
from circlepose.uncertainty.pairs import circle_pairs, placed_circles

PAIR_COLUMN_MEANING: Mapping[str, str] = {
    "image": "name of the image",
    "first": "name of the one circle; instance/circle where names repeat in the image",
    "second": "name of the other circle",
    "distance_mm": "distance of the two centers",
    "sigma_mm": "standard deviation of distance_mm, with the joint covariance of both poses",
    "angle_deg": "angle between the two normals",
    "sigma_deg": "standard deviation of angle_deg, along the direction in which the normals differ",
}
PAIR_COLUMNS: tuple[str, ...] = tuple(PAIR_COLUMN_MEANING)
PAIRS_SCHEMA = "circlepose.pairs/1"


def pair_rows(result: ImageResult) -> Iterator[Row]:
    """Yield the rows of one image in the layout `pairs`, by the chosen candidates; None is an empty cell.

    An image of fewer than two circles with a pose has one row, of its name.
    """
    placed = placed_circles(result)
    if len(placed) < 2:
        yield {"image": result.image}
        return
    names = circle_names(placed.circles)
    pairs = circle_pairs(placed)
    for first, second, *numbers in zip(
        pairs.first.tolist(),
        pairs.second.tolist(),
        pairs.distance_mm.tolist(),
        pairs.sigma_mm.tolist(),
        pairs.angle_deg.tolist(),
        pairs.sigma_deg.tolist(),
        strict=True,
    ):
        known = (number if math.isfinite(number) else None for number in numbers)
        yield dict(zip(PAIR_COLUMNS, (result.image, names[first], names[second], *known), strict=True))


def pair_record(row: Row) -> Row:
    """Return a row with all its keys."""
    return {column: row.get(column) for column in PAIR_COLUMNS}


def circle_names(circles: tuple[CircleResult, ...]) -> list[str]:
    """Return a name for each circle of an image, with the number of its target where names repeat."""
    number = Counter((circle.method, circle.circle) for circle in circles)
    repeat = any(times > 1 for times in number.values())
    return [f"{circle.instance}/{circle.circle}" if repeat else circle.circle for circle in circles]
