"""How much of a small square cell a region covers, to second order, and the cells themselves. Pure NumPy.

Within a cell (a sixth of a pixel or so) the rim F = 0 is taken as an arc: F, its gradient and its Hessian
at the cell's center give where the rim crosses the line of steepest ascent, and the area on one side of a
straight line through a square is known in closed form.

A cell weighs with a box or, where the lens's blur is wider than a cell, with a tent of twice the side: a second
box of one cell, which is then taken out of the blur. Sums over boxes see an edge jump from cell to cell
(an error of order size^2 in its width), sums over tents do not (size^4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ive

from circlepose._typing import FloatArray, IntArray
from circlepose.camera.camera import Camera

_KERNEL_REACH = 5.5
"""Half-width of the blur kernel in sigmas: beyond it lie 4e-8 of the light."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Square cells of the image plane, in any batch shape."""

    pixels: FloatArray
    """(..., 2) px, their centers in the raw image"""
    rays: FloatArray
    """(..., 3) unit; NaN outside the lens model"""
    ray_jacobian: FloatArray
    """(..., 3, 2) d ray / d pixel"""
    size: float
    """px, their side"""
    tent: bool = False
    """whether they weigh with a tent instead of a box"""

    def take(self, index: IntArray) -> Cells:
        """Return the cells at `index` of the first batch axis."""
        return Cells(self.pixels[index], self.rays[index], self.ray_jacobian[index], self.size, self.tent)


def cells_of(camera: Camera, pixels: FloatArray, number: int, tent: bool = False) -> Cells:
    """Split each of `pixels` (n, 2) into `number` x `number` cells; batch shape (n, number, number), rows first.

    The rays are biquadratic through nine exact ones per pixel: a lens bends so little within a pixel that
    the error is below 1e-6 px, and the derivative comes for free.
    """
    if number == 1:
        whole = pixels[:, None, None, :]
        return Cells(whole, *camera.rays_with_jacobian(whole), 1.0, tent)
    offsets = (np.arange(number) + 0.5) / number - 0.5
    value, slope = _lagrange(offsets)
    step = np.array([-0.5, 0.0, 0.5])
    nodes = pixels[:, None, None, :] + np.stack(np.meshgrid(step, step), axis=-1)
    rays = camera.rays(nodes)
    along_x, slope_x = (np.einsum("bj,eijk->eibk", weights, rays) for weights in (value, slope))
    jacobian = np.stack(
        [np.einsum("ai,eibk->eabk", value, slope_x), np.einsum("ai,eibk->eabk", slope, along_x)], axis=-1
    )
    centers = pixels[:, None, None, :] + np.stack(np.meshgrid(offsets, offsets), axis=-1)
    return Cells(centers, np.einsum("ai,eibk->eabk", value, along_x), jacobian, 1.0 / number, tent)


def half_plane_coverage(distance: FloatArray, direction: FloatArray, cells: Cells) -> FloatArray:
    """Return the fraction (...) of each cell with direction . x < distance (...) px, x from the cell's center.

    `direction` (..., 2) is a unit vector. Exact: the distribution of a sum of uniform variables, two for a
    box and four for a tent, which is a sum of powers of ramps.
    """
    both = np.sort(np.abs(direction), axis=-1)
    # A floor keeps the quotient alive for an edge along the cells; what it adds to the width is far below use.
    long, short = both[..., 1], np.maximum(both[..., 0], 3e-3 if cells.tent else 1e-6)
    s = np.clip(distance / cells.size, -2.0, 2.0)
    total = np.zeros_like(s)
    if cells.tent:
        for i, weight_i in ((-1, 1.0), (0, -2.0), (1, 1.0)):
            for j, weight_j in ((-1, 1.0), (0, -2.0), (1, 1.0)):
                total += weight_i * weight_j * np.maximum(s + i * long + j * short, 0.0) ** 4
        return np.asarray(np.clip(total / (24.0 * long**2 * short**2), 0.0, 1.0))
    for half_i in (-0.5, 0.5):
        for half_j in (-0.5, 0.5):
            total += 4.0 * half_i * half_j * np.maximum(s + half_i * long + half_j * short, 0.0) ** 2
    return np.asarray(np.clip(total / (2.0 * long * short), 0.0, 1.0))


def quadratic_coverage(value: FloatArray, gradient: FloatArray, hessian: FloatArray, cells: Cells) -> FloatArray:
    """Return the fraction (...) of each cell with F < 0; 0 where F is NaN.

    `value` (...), `gradient` (..., 2) and `hessian` (..., 2, 2) of F in px at the cells' centers, F convex
    near its zero. Both crossings of the line of steepest ascent count, so a sliver thinner than a cell is
    weighed right.
    """
    slope = np.hypot(gradient[..., 0], gradient[..., 1])
    flat = ~(slope > 0.0)
    direction = np.where(flat[..., None], [1.0, 0.0], gradient / np.where(flat, 1.0, slope)[..., None])
    turned = np.stack([-direction[..., 1], direction[..., 0]], axis=-1)
    bend = np.einsum("...i,...ij,...j->...", direction, hessian, direction)
    bend_along = np.einsum("...i,...ij,...j->...", turned, hessian, turned)
    # The rim's curvature, averaged over the cell: <t^2> = size^2 / 12 in every direction of a square's box.
    start = value + bend_along * cells.size**2 / (12.0 if cells.tent else 24.0)
    discriminant = slope**2 - 2.0 * bend * start
    root = slope + np.sqrt(np.maximum(discriminant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(root > 0.0, -2.0 * start / root, np.where(start < 0.0, np.inf, -np.inf))
        near = np.where(bend > 0.0, -root / bend, -np.inf)
    covered = half_plane_coverage(far, direction, cells) - half_plane_coverage(near, direction, cells)
    return np.where(discriminant >= 0.0, np.maximum(covered, 0.0), 0.0)


def takes_tents(blur_px: float, number: int) -> bool:
    """Whether the blur is wide enough for a second box of one cell to be taken out of it."""
    return blur_px * number >= 1.0


def blur_weights(blur_px: float, number: int) -> FloatArray:
    """Return the light (2 m + 1, number) that a column of cells of one pixel sends to the pixels -m ... m.

    The lens's Gaussian acts between cells, the pixel's box gathers them. Below one cell the Gaussian is the
    discrete one (Lindeberg's), whose variance is exact for any sigma.
    """
    sigma = blur_px * number
    if takes_tents(blur_px, number):
        sigma = np.sqrt(sigma**2 - 1.0 / 12.0)
    half = max(int(np.ceil(_KERNEL_REACH * sigma)), 8) if sigma > 0.0 else 0
    lag = np.arange(-half, half + 1)
    kernel = np.exp(-0.5 * (lag / sigma) ** 2) if sigma >= 0.9 else ive(np.abs(lag), sigma**2)
    kernel = kernel / kernel.sum()
    reach = -(-(half + number - 1) // number)
    between = (
        np.arange(-reach, reach + 1)[:, None, None] * number
        + np.arange(number)[None, None, :]
        - np.arange(number)[None, :, None]
    )
    known = np.abs(between) <= half
    light = np.where(known, kernel[np.clip(between + half, 0, 2 * half)], 0.0)
    return np.asarray(light.mean(axis=-1))


def _lagrange(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the three quadratic basis functions (n, 3) of the nodes -1/2, 0, 1/2 at `x` (n,), and their slopes."""
    value = np.stack([2.0 * x**2 - x, 1.0 - 4.0 * x**2, 2.0 * x**2 + x], axis=-1)
    slope = np.stack([4.0 * x - 1.0, -8.0 * x, 4.0 * x + 1.0], axis=-1)
    return value, slope
