"""The level of pixels near the rim of a viewing cone, seen as a blurred edge, and its derivatives. Many rims at once.

With c the share of the inside in a pixel's level (see `blurred_share`), z = (c's distance)/sigma and p = y_12/y_3 the
place in the coordinates y = A^-1 x of the cone's factor,

    I = out(p) (1 - c) + in(p) c + w (Phi(z') - Phi(z)).

`in` and `out` are harmonic polynomials of p: even shading is met exactly, texture in the main. The last term stands
for what blur is beside a Gaussian (halos of sharpening, tails of focus; z' is of a wider blur); odd about the edge,
it cannot move it. These eleven levels are linear, and so eliminated; there remain the five `rim_modes` and sigma.
All but the two mean levels are expected to be small beside the contrast, so that a disc of few pixels is not
overfitted: `stiffness` says how small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from circlepose._typing import FloatArray, RealArray
from circlepose.photometry.edge_spread import SHAPES, Places, Share
from circlepose.photometry.gaussian import normal_share
from circlepose.photometry.pixel_band import Bands

LINEAR = 11
"""Levels in all: harmonic polynomials inside and outside, and the term beside a Gaussian."""
FINEST, FINEST_CURVED = 6, 9
"""Order of the finest harmonic of texture; the second where shares are `curved`: on an elongated disc texture is
steep across the rim. With 6 there, the center is off along the major axis by twice its sigma."""
_BAND_PX = 4.0
_RIDGE = 1e-9
"""Relative to the mean square of the columns: levels that no pixel tells of stay finite."""
_WIDER = 2.5
_EXPECTED = np.array([np.inf, 0.2, 0.2, 0.1, 0.1, np.inf, 0.2, 0.2, 0.1, 0.1, 0.3])
"""Standard deviation of each level before the image is seen, as a share of the contrast."""
_QUADRATIC = np.array([3, 4, 8, 9])
_WIDE_PX = 40.0
"""Radius from which shading may curve as strongly as that; over a smaller disc, less by the square of the radius."""
_PLAIN = np.array([*_EXPECTED[:-1], 1e-4])


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The levels that fit best, for given cones and blurs; a pixel counts with its weight, 0 or 1."""

    residual: RealArray
    """(m, k) model minus measured"""
    slopes: RealArray
    """(m, 8, k) derivatives to the five modes and the blur, at fixed levels"""
    linear: RealArray
    """(m, l + 1, k) derivatives to the levels, and what was measured"""
    gram: FloatArray
    """(m, l, l) information on the levels, times the noise's variance"""
    levels: FloatArray
    """(m, l) with l 11, or more where there is texture"""
    model: RealArray
    """(m, k) the level, whatever the weight"""
    square: FloatArray
    """(m,) sum of squares of the residual"""
    cost: FloatArray
    """(m,) the same, and that of levels that are not as expected"""

    @property
    def contrast(self) -> FloatArray:
        """Levels inside minus outside, on average around the rim (m,)."""
        return self.levels[:, 0] - self.levels[:, self.levels.shape[1] // 2]

    def normal_equations(self) -> Equations:
        """Return the equations of the modes and the blur, the levels eliminated."""
        across = (self.linear @ self.slopes.transpose(0, 2, 1)).astype(np.float64)[:, :-1]
        made_up = np.linalg.solve(self.gram, across)
        # In halves: a whole matrix by itself transposed goes another way in BLAS, which takes four times longer here.
        half = self.slopes.shape[1] // 2
        transposed = self.slopes.transpose(0, 2, 1)
        parts = (self.slopes[:, :half] @ transposed, self.slopes[:, half:] @ transposed)
        matrix = np.concatenate(parts, axis=1).astype(np.float64)
        matrix -= across.transpose(0, 2, 1) @ made_up
        # The cost is least in the levels, so their change with the modes does not count.
        gradient = (self.slopes @ self.residual[..., None])[..., 0].astype(np.float64)
        return Equations(matrix, gradient, np.asarray(made_up))

    def joined_with(self, more: MoreLevels, equations: Equations) -> tuple[Levels, Equations]:
        """Return the levels that fit to what `more` there is known, too, and the `equations` that go with them.

        For a change of levels that is small: the slopes, which they scale, and the model are left as they are.
        """
        gram = self.gram + more.gram
        change = np.linalg.solve(gram, (more.right - (more.gram @ self.levels[..., None])[..., 0])[..., None])
        levels = self.levels + change[..., 0]
        across = self.gram @ equations.made_up
        made_up = np.asarray(np.linalg.solve(gram, across))
        transposed = across.transpose(0, 2, 1)
        joined = Equations(
            equations.matrix + transposed @ (equations.made_up - made_up),
            equations.gradient + (transposed @ change)[..., 0],
            made_up,
        )
        moved = (change.transpose(0, 2, 1).astype(self.linear.dtype) @ self.linear[:, :-1])[:, 0]
        cost = self.cost + np.sum(change * (self.gram @ change), axis=(1, 2)) + more.misfit(levels)
        return replace(self, residual=self.residual + moved, gram=gram, levels=levels, cost=cost), joined

    def projected_slopes(self, equations: Equations) -> RealArray:
        """Return the slopes (m, 8, k) less what the levels make up for, which is no information."""
        made_up = equations.made_up.transpose(0, 2, 1).astype(self.slopes.dtype)
        return self.slopes - made_up @ self.linear[:, :-1]


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Normal equations of modes and blur, the levels eliminated."""

    matrix: FloatArray
    """(m, 8, 8)"""
    gradient: FloatArray
    """(m, 8)"""
    made_up: FloatArray
    """(m, l, 8) the change of levels that makes up best for each of the slopes"""


def stiffness(
    variance: FloatArray, contrast: FloatArray, radius_px: FloatArray, *, plain: bool = False
) -> FloatArray:
    """Return (m, 11) the weight of squared levels beside squared residuals with `variance` (m,).

    A rim is of some `radius_px` (m,); an edge that is `plain` has no more than its Gaussian blur.
    """
    expected = np.maximum(np.abs(contrast), 1e-9)[:, None] * (_PLAIN if plain else _EXPECTED)
    expected[:, _QUADRATIC] *= np.minimum(radius_px / _WIDE_PX, 1.0)[:, None] ** 2
    return np.asarray(variance[:, None] / expected**2)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """What the levels multiply, and the sums over pixels in which they are linear."""

    share: Share
    shapes: RealArray
    """(m, s, k), 5 or more"""
    columns: RealArray
    """(m, 2 s + 2, k) derivatives to the levels, and what was measured, whatever the weight"""
    weighted: RealArray
    """(m, 2 s + 2, k)"""
    weight: RealArray
    """(m, k)"""
    products: FloatArray
    """(m, 2 s + 2, 2 s + 2)"""
    odd_slope: RealArray
    """(m, k) change of the last column with the edge, relative to that of the share"""

    def noise_and_contrast(self) -> tuple[FloatArray, FloatArray]:
        """Return about the sum of squared residuals (m,), and inside minus outside (m,), with free levels.

        By the sums alone, which is quick, and to a few hundredths of a squared level for each pixel.
        """
        gram, right = _regular(self.products[:, :-1, :-1]), self.products[:, :-1, -1]
        levels = np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])
        square = self.products[:, -1, -1] - np.sum(levels * right, axis=1)
        return square, levels[:, 0] - levels[:, self.shapes.shape[1]]

    @classmethod
    def of(cls, bands: Bands, at: Places, share: Share, *, finest: int = 0) -> Self:
        """Return those of the pixels of `bands`, `at` their places, with their `share`.

        With levels for texture up to harmonics of that `finest` order; 0 for none.
        """
        z = share.z
        shapes = texture_shapes(at, finest) if finest else at.shapes
        number = shapes.shape[1]
        # A multiple of four rows, which products of matrices like; what was measured among them, as the right side.
        columns = np.empty((len(z), 2 * number + 2, z.shape[1]), z.dtype)
        np.multiply(shapes, share.share[:, None], out=columns[:, :number])
        np.subtract(shapes, columns[:, :number], out=columns[:, number:-2])
        across, along = share.widths.across, share.widths.along
        wide = -(at.distance_px / _WIDER + 0.5 * _WIDER * at.curvature * along**2) / across
        columns[:, -2] = normal_share(wide)[1] - share.straight
        columns[:, -1] = bands.levels
        odd_slope = np.exp(np.minimum(0.5 * (z * z - wide * wide), 8.0)) / _WIDER - 1.0
        weighted = columns * bands.weight[:, None]
        products = (weighted @ columns.transpose(0, 2, 1)).astype(np.float64)
        return cls(share, shapes, columns, weighted, bands.weight, products, odd_slope)


class MoreLevels(Protocol):
    """What is known of the levels beside the pixels in a band: sums of squares."""

    @property
    def gram(self) -> FloatArray:
        """(m, 11, 11)."""

    @property
    def right(self) -> FloatArray:
        """(m, 11)."""

    def misfit(self, levels: FloatArray) -> FloatArray:
        """Return (m,) the sum of squares at `levels` (m, 11)."""


def fit_levels(columns: Columns, stiff: FloatArray, more: MoreLevels | None = None) -> Levels:
    """Fit the levels of m blurred edges, as `stiff` as (m, l) says, and with what `more` there is known of them."""
    share, shapes = columns.share, columns.shapes
    number = shapes.shape[1]
    gram = _regular(columns.products[:, :-1, :-1], stiff)
    right = columns.products[:, :-1, -1]
    if more is not None:
        gram, right = gram + more.gram, right + more.right
    levels = np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])
    few = levels.astype(shapes.dtype)[:, None]
    model = (few @ columns.columns[:, :-1])[:, 0]
    residual = (model - columns.columns[:, -1]) * columns.weight
    step = ((few[..., :number] - few[..., number:-1]) @ shapes)[:, 0]
    # The odd term moves with the edge.
    step += few[..., -1] * columns.odd_slope
    step *= columns.weight
    square = np.einsum("mk,mk->m", residual, residual).astype(np.float64)
    return Levels(
        residual=residual,
        slopes=share.by_parameters * step[:, None],
        linear=columns.weighted,
        gram=gram,
        levels=levels,
        model=model,
        square=square,
        cost=square + np.sum(stiff * levels**2, axis=1) + (0.0 if more is None else more.misfit(levels)),
    )


def _regular(gram: FloatArray, stiff: FloatArray | float = 0.0) -> FloatArray:
    """Return the information (m, l, l) on levels with that of `stiff` (m, l), and a little of any."""
    ridge = _RIDGE * np.trace(gram, axis1=1, axis2=2) / gram.shape[1] + 1e-30
    return np.asarray(gram + (stiff + ridge[:, None])[:, :, None] * np.eye(gram.shape[1]))


def textures(finest: int) -> int:
    """Return how many levels for texture there are on each side, with harmonics up to an order `finest`."""
    return 1 + 2 * finest + 2 * (finest - 2)


def texture_shapes(at: Places, finest: int = FINEST) -> RealArray:
    """Return the `harmonics` (m, 5 + t, k) and what texture may add: finer ones, and slopes across the rim, as fine.

    That is what a level that varies on the scale of the band or more does within it, to first order.
    """
    p0, p1 = at.plane
    shapes = np.empty((len(p0), SHAPES + textures(finest), p0.shape[1]), p0.dtype)
    shapes[:, :SHAPES] = at.shapes
    per_radius = 1.0 / np.maximum(at.radius, 1e-6)
    u0, u1 = p0 * per_radius, p1 * per_radius
    slope = at.distance_px * (1.0 / _BAND_PX)
    cos, sin = np.ones_like(u0), np.zeros_like(u0)
    shapes[:, SHAPES] = slope
    place = SHAPES + 1
    for order in range(1, finest + 1):
        cos, sin = cos * u0 - sin * u1, cos * u1 + sin * u0
        if order > 2:
            shapes[:, place], shapes[:, place + 1] = cos, sin
            place += 2
        np.multiply(slope, cos, out=shapes[:, place])
        np.multiply(slope, sin, out=shapes[:, place + 1])
        place += 2
    return shapes
