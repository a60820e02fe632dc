"""All edge chains of an image in one array, with their measures, without a Python loop over chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from circlepose._batching import in_parts
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.geometry.ellipse import Ellipse

_CORNERS = 64
_COMPACT = 1.5
"""Longer over shorter side of the box of a dot, in whole pixels, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """Closed chains of neighboring pixels: chain i holds `points[starts[i] : starts[i] + sizes[i]]`."""

    points: NDArray[np.signedinteger[Any]]
    """(n, 2) px; 16 bits where these suffice, as a page of text has more points than pixels"""
    starts: IntArray
    """(m,) index of the first point"""
    sizes: IntArray
    """(m,) number of points"""
    parents: IntArray
    """(m,) index of the outer border of the same edge, for the border of a hole; else -1"""
    dots: int = 0
    """number of compact closed edges smaller than was asked for, also of those too short for a chain"""

    @classmethod
    def of_borders(
        cls,
        borders: Sequence[NDArray[Any]],
        hierarchy: NDArray[Any] | None,
        shortest: int,
        *,
        size: int,
        dot_px: float = 0.0,
    ) -> Self:
        """Join the borders (k, 1, 2) that OpenCV finds, without those too short; `hierarchy` is that of RETR_CCOMP.

        The longer side of the image is `size` px. Closed edges smaller than `dot_px` are counted as dots.
        """
        kind: type[np.signedinteger[Any]] = np.int16 if size <= np.iinfo(np.int16).max else np.int32
        sizes = np.fromiter(map(len, borders), np.int64, len(borders))
        chosen = np.flatnonzero(sizes >= shortest)
        parents = np.full(len(borders), -1) if hierarchy is None else hierarchy[0, :, 3].astype(np.int64)
        # A chain whose parent was too short has none.
        place = np.full(len(borders) + 1, -1)
        place[chosen] = np.arange(len(chosen))
        joined = np.empty((int(sizes[chosen].sum()), 1, 2), kind)
        if len(chosen):
            np.concatenate([borders[i] for i in chosen.tolist()], out=joined, casting="same_kind")
        return cls(
            points=joined[:, 0],
            starts=np.cumsum(sizes[chosen]) - sizes[chosen],
            sizes=sizes[chosen],
            parents=place[parents[chosen]],
            dots=0 if hierarchy is None else _dots(borders, sizes, hierarchy[0, :, 2] >= 0, dot_px),
        )

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the chains of all `parts` of an image."""
        points, chains = (np.cumsum([0, *map(len, each)]) for each in ([p.points for p in parts], parts))
        return cls(
            points=np.concatenate([part.points for part in parts]),
            starts=np.concatenate([part.starts + before for part, before in zip(parts, points, strict=False)]),
            sizes=np.concatenate([part.sizes for part in parts]),
            parents=np.concatenate(
                [part.parents + before * (part.parents >= 0) for part, before in zip(parts, chains, strict=False)]
            ),
            dots=sum(part.dots for part in parts),
        )

    def __len__(self) -> int:
        return len(self.starts)

    def __getitem__(self, which: IntArray | BoolArray) -> Self:
        """Return the chains that `which` selects, without their parents."""
        index = np.flatnonzero(which) if which.dtype == np.bool_ else which
        sizes = self.sizes[index]
        starts = np.cumsum(sizes) - sizes
        rows = np.repeat(self.starts[index] - starts, sizes)
        rows += np.arange(len(rows))
        return type(self)(self.points[rows], starts, sizes, np.full(len(index), -1))

    @property
    def owner(self) -> IntArray:
        """(n,) index of the chain of each point."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def extents(self) -> IntArray:
        """Return the longer side (m,), px, of each chain's upright box."""
        if len(self) == 0:
            return np.empty(0, np.int64)
        spans = np.maximum.reduceat(self.points, self.starts) - np.minimum.reduceat(self.points, self.starts)
        return spans.max(axis=1).astype(np.int64)

    def shares(self, marked: BoolArray) -> FloatArray:
        """Return the share (m,) of each chain's points that are `marked` (n,)."""
        if len(self) == 0:
            return np.empty(0)
        return np.add.reduceat(marked.astype(np.int64), self.starts) / self.sizes

    def samples(self, which: IntArray, number: int) -> FloatArray:
        """Return points (k, number, 2), px, evenly taken from each of the chains `which` (k,)."""
        steps = (np.arange(number)[None, :] * self.sizes[which, None]) // number
        return self.points[self.starts[which, None] + steps].astype(np.float64)

    def moment_ellipses(self, which: IntArray) -> tuple[Ellipse, FloatArray]:
        """Return the ellipse with the area moments (up to the second) of what each of the chains `which` encloses.

        And (k,) the enclosed area over that of the ellipse: 1 for an ellipse, less for any other shape, about 0
        for a chain that goes there and back. Green's theorem over a polygon of 64 of its points.
        """
        # Of a page of text there are thousands: in parts, so that what is in memory is bounded.
        return in_parts(self._moments, which)

    def _moments(self, which: IntArray) -> tuple[Ellipse, FloatArray]:
        origin = self.points[self.starts[which]]
        corners = self.samples(which, _CORNERS) - origin[:, None, :]
        x, y = corners[..., 0], corners[..., 1]
        following = np.concatenate([corners[:, 1:], corners[:, :1]], axis=1)
        u, v = following[..., 0], following[..., 1]
        turn = x * v - u * y
        area = turn.sum(axis=1) / 2.0
        mx, my = (np.einsum("mk,mk->m", turn, term) / 6.0 for term in (x + u, y + v))
        xx, yy = (np.einsum("mk,mk->m", turn, p * p + p * q + q * q) / 12.0 for p, q in ((x, u), (y, v)))
        xy = np.einsum("mk,mk->m", turn, x * v + 2.0 * (x * y + u * v) + u * y) / 24.0
        safe = np.where(np.abs(area) > 0.5, area, np.inf)
        cx, cy = mx / safe, my / safe
        xx, yy, xy = xx / safe - cx * cx, yy / safe - cy * cy, xy / safe - cx * cy
        ellipse = Ellipse.from_square(np.stack([cx, cy], axis=1) + origin, 4.0 * xx, 4.0 * xy, 4.0 * yy)
        full = np.pi * ellipse.semi_major * ellipse.semi_minor
        return ellipse, np.where(full > 0.0, np.abs(area) / np.where(full > 0.0, full, 1.0), 0.0)


def _dots(borders: Sequence[NDArray[Any]], sizes: IntArray, is_closed: BoolArray, dot_px: float) -> int:
    """Return how many closed edges, by their outer borders, are compact and smaller than `dot_px`.

    The edge of a dot closes around it, and its border is as wide as the dot. Noise and texture leave open pieces.
    """
    which = np.flatnonzero(is_closed & (sizes <= 4.0 * dot_px))
    if len(which) == 0:
        return 0
    points = np.concatenate([borders[i][:, 0] for i in which.tolist()])
    starts = np.cumsum(sizes[which]) - sizes[which]
    spans = np.maximum.reduceat(points, starts) - np.minimum.reduceat(points, starts)
    longer, shorter = spans.max(axis=1), spans.min(axis=1)
    return int(np.count_nonzero((longer < dot_px) & (longer + 1 <= _COMPACT * (shorter + 1))))
