"""A scene to an image: exact area sampling under the full lens model, blur, noise, rounding.

Light adds up, so the image is split in two. Each pixel gets one grey level (its mean); those that a rim
crosses are also cut into cells, whose deviations from that mean are sent to the pixels around
with the weights of lens and pixel. Away from rims nothing needs cells. What light a pixel gets:

    I(p) = sum over pixels k, cells j of k:  A(p - k, j) v(k, j),    A = box of the pixel * Gaussian of the lens
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image, IntArray
from circlepose.camera import Camera
from circlepose.synthesis.coverage import Cells, blur_weights, cells_of
from circlepose.synthesis.layers import Layer, Part, layers
from circlepose.synthesis.regions import Region
from circlepose.synthesis.scene import Circle, Scene
from circlepose.synthesis.texture import add_noise, mottle

OVERSAMPLING = 6
"""Cells per pixel and axis; see docs/rendering.md for what that gives."""
_CHUNK_CELLS = 1 << 17
_FLAT_CHUNK = 1 << 16


@dataclass(frozen=True, slots=True)
class TruthRow:
    """One row of `truth.csv`."""

    image: str
    instance: int
    circle: Circle


def truth_rows(scene: Scene) -> tuple[TruthRow, ...]:
    """Return the true poses of all circles of `scene`, in the order of its targets."""
    return tuple(
        TruthRow(scene.name, instance, circle)
        for instance, target in enumerate(scene.targets)
        for circle in target.circles
    )


def render(scene: Scene, oversampling: int = OVERSAMPLING) -> Image:
    """Return the image (h, w) of `scene`, uint8 or uint16, with noise and rounding."""
    image = render_float(scene, oversampling)
    if scene.noise_levels > 0.0:
        add_noise(image, scene.noise_levels, scene.noise_seed)
    np.clip(image, 0.0, 255.0, out=image)
    if scene.bit_depth == 16:
        return np.rint(image * 257.0).astype(np.uint16)
    return np.rint(image, out=image).astype(np.uint8)


def render_float(scene: Scene, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Return the image (h, w) in grey levels (0 to 255, not clipped) without noise or rounding.

    It is a smooth function of the poses: a difference quotient with steps of 1e-3 mm is a derivative.

    Parameters
    ----------
    scene
        What to render.
    oversampling
        Cells per pixel and axis, where a rim crosses the pixel.
    """
    weights = blur_weights(scene.blur_px, oversampling)
    reach = len(weights) // 2
    # Light comes from `reach` pixels outside the image, and is sent as far again from there.
    canvas = _Canvas(scene, margin=2 * reach)
    stack = [[_trace(canvas, part) for part in layer.parts] for layer in layers(scene)]
    crossed = np.zeros(canvas.shape, dtype=np.bool_)
    for region in (region for traced in stack for region in traced):
        crossed[region.rows, region.columns] |= region.crossed
    image = _flat_image(canvas, stack)
    rows, columns = (at + reach for at in np.nonzero(crossed[reach : crossed.shape[0] - reach, reach : crossed.shape[1] - reach]))
    chunk = max(1, _CHUNK_CELLS // oversampling**2)
    spread = []
    for start in range(0, len(rows), chunk):
        index = (rows[start : start + chunk], columns[start : start + chunk])
        fine = _fine_levels(canvas, stack, index, oversampling)
        mean = fine.mean(axis=(1, 2))
        image[index] = mean
        patches = weights @ (fine - mean[:, None, None]) @ weights.T
        spread.append((index, patches))
    return canvas.finish(image, weights, spread)


class _Canvas:
    """The image with a margin, so that light from just outside it is not lost."""

    def __init__(self, scene: Scene, margin: int) -> None:
        width, height = scene.image_size
        self.scene = scene
        self.camera: Camera = scene.camera
        self.margin = margin
        self.shape = (height + 2 * margin, width + 2 * margin)

    def pixels(self, index: tuple[IntArray, IntArray]) -> FloatArray:
        """Return the image coordinates (n, 2) of canvas rows and columns."""
        return np.stack([index[1] - self.margin, index[0] - self.margin], axis=-1).astype(np.float64)

    def finish(
        self, image: FloatArray, weights: FloatArray, spread: list[tuple[tuple[IntArray, IntArray], FloatArray]]
    ) -> FloatArray:
        """Blur the pixels' means, add the deviations of the cells, cut the margin off and shade."""
        kernel, reach = weights.sum(axis=1), len(weights) // 2
        if reach > 0:
            image = np.asarray(cv2.sepFilter2D(image, -1, kernel, kernel, borderType=cv2.BORDER_REPLICATE))
        for (rows, columns), patches in spread:
            for down in range(len(weights)):
                for right in range(len(weights)):
                    # The pixels of one chunk are distinct, so an indexed sum loses none.
                    image[rows + down - reach, columns + right - reach] += patches[:, down, right]
        m = self.margin
        image = image[m : self.shape[0] - m, m : self.shape[1] - m].copy()
        height, width = image.shape
        shading = self.scene.shading
        if shading.right != 0.0 or shading.down != 0.0:
            across = (np.arange(width) + 0.5) / width - 0.5
            along = (np.arange(height) + 0.5) / height - 0.5
            image *= 1.0 + shading.down * along[:, None] + shading.right * across
        return image


@dataclass(frozen=True, slots=True, eq=False)
class _Traced:
    """A part on the canvas: the pixels its rim crosses and those wholly inside, in a window."""

    part: Part
    rows: slice
    columns: slice
    crossed: BoolArray
    inside: BoolArray


def _trace(canvas: _Canvas, part: Part) -> _Traced:
    rims = part.region.rims(canvas.camera)
    points = np.concatenate(rims) + canvas.margin
    seen = np.isfinite(points[:, 0])
    height, width = canvas.shape
    # A rim that is partly unseen does not part inside from outside: then every pixel is asked.
    whole = bool(np.all(seen))
    points = points[seen]
    low, high = np.array([0, 0]), np.array([width, height])
    if whole:
        low = np.clip(np.floor(points.min(axis=0)) - 3, 0, high).astype(np.int64)
        high = np.clip(np.ceil(points.max(axis=0)) + 4, low, high).astype(np.int64)
    window = (slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0])))
    marks = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    if marks.size == 0:
        nothing = marks.astype(np.bool_)
        return _Traced(part, *window, nothing, nothing)
    points = points[np.all((points > low - 3) & (points < high + 3), axis=1)]
    at = np.rint(points).astype(np.int64) - low
    # Half a pixel between points at most: the pixel of each and its neighbours hold the rim.
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            y, x = at[:, 1] + down, at[:, 0] + right
            held = (y >= 0) & (y < marks.shape[0]) & (x >= 0) & (x < marks.shape[1])
            marks[y[held], x[held]] = 1
    crossed = marks.astype(np.bool_)
    inside = _inside(canvas, part.region, window, crossed, whole)
    return _Traced(part, *window, crossed, inside)


def _inside(
    canvas: _Canvas, region: Region, window: tuple[slice, slice], crossed: BoolArray, whole: bool
) -> BoolArray:
    """Tell which uncrossed pixels of the window are inside: one question per connected area, or per pixel."""
    offset = np.array([window[0].start, window[1].start])
    if not whole:
        inside = np.zeros(crossed.shape, dtype=np.bool_)
        rows, columns = np.nonzero(~crossed)
        for start in range(0, len(rows), _FLAT_CHUNK):
            index = (rows[start : start + _FLAT_CHUNK], columns[start : start + _FLAT_CHUNK])
            inside[index] = _asked(canvas, region, (index[0] + offset[0], index[1] + offset[1]))
        return inside
    number, labels = cv2.connectedComponents((~crossed).astype(np.uint8), connectivity=4)
    # Any one pixel of each area stands for it.
    sample = np.zeros(number, dtype=np.int64)
    sample[labels.ravel()] = np.arange(labels.size)
    rows, columns = np.divmod(sample, crossed.shape[1])
    answer = _asked(canvas, region, (rows + offset[0], columns + offset[1]))
    # Label 0 is the crossed pixels themselves.
    answer[0] = False
    return np.asarray(answer[labels])


def _asked(canvas: _Canvas, region: Region, index: tuple[IntArray, IntArray]) -> BoolArray:
    cells = cells_of(canvas.camera, canvas.pixels(index), 1)
    return np.asarray(region.coverage(cells)[:, 0, 0] > 0.5)


def _flat_image(canvas: _Canvas, stack: list[list[_Traced]]) -> FloatArray:
    """Return each pixel's grey level at its centre (h, w); right where no rim crosses it."""
    background = canvas.scene.background
    image = np.full(canvas.shape, background.level)
    if background.texture is not None:
        x = np.arange(canvas.shape[1]) - canvas.margin
        for row in range(canvas.shape[0]):
            points = np.stack([x, np.full_like(x, row - canvas.margin)], axis=-1).astype(np.float64)
            image[row] += mottle(background.texture, points)
    for traced in (traced for parts in stack for traced in parts):
        window = image[traced.rows, traced.columns]
        if traced.part.paint.texture is None:
            window[traced.inside] = traced.part.paint.level
            continue
        rows, columns = np.nonzero(traced.inside)
        for start in range(0, len(rows), _FLAT_CHUNK):
            here = (rows[start : start + _FLAT_CHUNK], columns[start : start + _FLAT_CHUNK])
            index = (here[0] + traced.rows.start, here[1] + traced.columns.start)
            window[here] = traced.part.levels(cells_of(canvas.camera, canvas.pixels(index), 1))[:, 0, 0]
    return image


def _fine_levels(
    canvas: _Canvas, stack: list[list[_Traced]], index: tuple[IntArray, IntArray], number: int
) -> FloatArray:
    """Return the grey levels (n, number, number) of the cells of the pixels at `index`."""
    cells = cells_of(canvas.camera, canvas.pixels(index), number)
    background = canvas.scene.background
    levels = np.full(cells.pixels.shape[:-1], background.level)
    if background.texture is not None:
        levels += mottle(background.texture, cells.pixels)
    for parts in stack:
        under = levels.copy()
        for traced in parts:
            touched, covered = _covered(traced, cells, index)
            own = traced.part.levels(cells.take(touched))
            levels[touched] += covered * (own - under[touched])
            under[touched] = own
    return levels


def _covered(traced: _Traced, cells: Cells, index: tuple[IntArray, IntArray]) -> tuple[IntArray, FloatArray]:
    """Return which of the pixels the part touches (m,), and its coverage of their cells (m, number, number)."""
    rows, columns = index[0] - traced.rows.start, index[1] - traced.columns.start
    height, width = traced.crossed.shape
    held = np.nonzero((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width))[0]
    crossed = traced.crossed[rows[held], columns[held]]
    touched = held[crossed | traced.inside[rows[held], columns[held]]]
    crossed = traced.crossed[rows[touched], columns[touched]]
    covered = np.ones((len(touched), *cells.pixels.shape[1:-1]))
    covered[crossed] = traced.part.region.coverage(cells.take(touched[crossed]))
    return touched, covered


__all__ = ["OVERSAMPLING", "Layer", "TruthRow", "render", "render_float", "truth_rows"]
