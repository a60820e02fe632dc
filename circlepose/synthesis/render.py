"""A scene to an image: exact area sampling under the full lens model, blur, noise, rounding.

Light adds up, so the image is split in two. Each pixel gets one gray level (its mean); those that a rim
crosses are also cut into cells, whose deviations from that mean are sent to the pixels around
with the weights of lens and pixel. Away from rims nothing needs cells. What light a pixel gets:

    I(p) = sum over pixels k, cells j of k:  A(p - k, j) v(k, j),    A = box of the pixel * Gaussian of the lens
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.synthesis.canvas import Canvas, PixelIndex, Traced, chunks, trace
from circlepose.synthesis.coverage import Cells, blur_weights, takes_tents
from circlepose.synthesis.layers import layers
from circlepose.synthesis.scene import BoardPart, Circle, Paint, Scene, Shading
from circlepose.synthesis.texture import add_noise, mottle

OVERSAMPLING = 6
"""Cells per pixel and axis; docs/rendering.md says what that gives."""
_CHUNK_CELLS = 1 << 17
"""Cells handled at a time, to bound the memory."""


@dataclass(frozen=True, slots=True)
class TruthRow:
    """One row of `truth.csv`."""

    image: str
    instance: int
    circle: Circle


def truth_rows(scene: Scene) -> tuple[TruthRow, ...]:
    """Return the true poses of all circles of a scene.

    Parameters
    ----------
    scene
        Whose targets are meant.

    Returns
    -------
    A row for each circle, in the order of the targets; lengths in mm, camera frame.
    """
    return tuple(
        TruthRow(scene.name, instance, circle)
        for instance, target in enumerate(scene.targets)
        for circle in target.circles
    )


@dataclass(frozen=True, slots=True)
class BoardTruthRow:
    """One row of `truth_boards.csv`."""

    image: str
    instance: int
    board: BoardPart


def board_truth_rows(scene: Scene) -> tuple[BoardTruthRow, ...]:
    """Return the true poses of all boards of a scene, in the order of the targets, which number them."""
    return tuple(
        BoardTruthRow(scene.name, instance, target)
        for instance, target in enumerate(scene.targets)
        if isinstance(target, BoardPart)
    )


def render(scene: Scene, oversampling: int = OVERSAMPLING) -> Image:
    """Render a scene as a photograph, with noise and rounding.

    Parameters
    ----------
    scene
        What to render.
    oversampling
        Cells per pixel and axis, where a rim crosses the pixel.

    Returns
    -------
    The image (h, w), uint8 or uint16 by the scene's bit depth.
    """
    image = render_float(scene, oversampling)
    if scene.noise_levels > 0.0:
        add_noise(image, scene.noise_levels, scene.noise_seed)
    np.clip(image, 0.0, 255.0, out=image)
    if scene.bit_depth == 16:
        return np.rint(image * 257.0).astype(np.uint16)
    return np.rint(image, out=image).astype(np.uint8)


def render_float(scene: Scene, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Render a scene without noise and rounding.

    It is a smooth function of the poses: a difference quotient with steps of 1e-3 mm is a derivative.

    Parameters
    ----------
    scene
        What to render.
    oversampling
        Cells per pixel and axis, where a rim crosses the pixel.

    Returns
    -------
    The image (h, w) in gray levels, 0 to 255, not clipped.
    """
    weights = blur_weights(scene.blur_px, oversampling)
    reach = len(weights) // 2
    # Light comes from `reach` pixels outside the image, and those send it as far again.
    canvas = Canvas(scene.camera, scene.image_size, margin=2 * reach)
    stack = [[trace(canvas, part) for part in layer.parts] for layer in layers(scene)]
    image = _flat_image(canvas, scene.background, stack)
    crossed = np.zeros(canvas.shape, dtype=np.bool_)
    for parts in stack:
        for traced in parts:
            crossed[traced.rows, traced.columns] |= traced.crossed
    within = crossed[reach : canvas.shape[0] - reach, reach : canvas.shape[1] - reach]
    rows, columns = (at + reach for at in np.nonzero(within))
    step = max(1, _CHUNK_CELLS // oversampling**2)
    tent = takes_tents(scene.blur_px, oversampling)
    spread: list[tuple[PixelIndex, FloatArray]] = []
    for start in range(0, len(rows), step):
        index = (rows[start : start + step], columns[start : start + step])
        levels = _cell_levels(canvas.cells(index, oversampling, tent), scene.background, stack, index)
        mean = levels.mean(axis=(1, 2))
        image[index] = mean
        spread.append((index, weights @ (levels - mean[:, None, None]) @ weights.T))
    image = _gather(image, weights, spread, canvas.margin)
    _shade(image, scene.shading)
    return image


def _gather(
    image: FloatArray, weights: FloatArray, spread: list[tuple[PixelIndex, FloatArray]], margin: int
) -> FloatArray:
    """Blur the pixels' means, add the deviations of the cells, and cut the margin off."""
    kernel, reach = weights.sum(axis=1), len(weights) // 2
    if reach > 0:
        image = np.asarray(cv2.sepFilter2D(image, -1, kernel, kernel, borderType=cv2.BORDER_REPLICATE))
    for (rows, columns), patches in spread:
        for down in range(len(weights)):
            for right in range(len(weights)):
                # The pixels of one chunk are distinct, so an indexed sum loses none.
                image[rows + down - reach, columns + right - reach] += patches[:, down, right]
    return image[margin : image.shape[0] - margin, margin : image.shape[1] - margin].copy()


def _shade(image: FloatArray, shading: Shading) -> None:
    if shading.right == 0.0 and shading.down == 0.0:
        return
    height, width = image.shape
    across = (np.arange(width) + 0.5) / width - 0.5
    along = (np.arange(height) + 0.5) / height - 0.5
    image *= 1.0 + shading.down * along[:, None] + shading.right * across


def _flat_image(canvas: Canvas, background: Paint, stack: list[list[Traced]]) -> FloatArray:
    """Return each pixel's gray level at its center; right where no rim crosses it."""
    image = np.full(canvas.shape, background.level, dtype=np.float64)
    if background.texture is not None:
        for index in chunks(np.ones(canvas.shape, dtype=np.bool_)):
            points = np.stack([index[1] - canvas.margin, index[0] - canvas.margin], axis=-1)
            image[index] += mottle(background.texture, points.astype(np.float64))
    for parts in stack:
        for traced in parts:
            window = image[traced.rows, traced.columns]
            if traced.part.paint.texture is None:
                window[traced.inside] = traced.part.paint.level
                continue
            for rows, columns in chunks(traced.inside):
                cells = canvas.cells((rows + traced.rows.start, columns + traced.columns.start))
                window[rows, columns] = traced.part.levels(cells)[:, 0, 0]
    return image


def _cell_levels(cells: Cells, background: Paint, stack: list[list[Traced]], index: PixelIndex) -> FloatArray:
    """Return the gray levels (n, number, number) of `cells`, those of the pixels at `index`."""
    levels = np.full(cells.pixels.shape[:-1], background.level, dtype=np.float64)
    if background.texture is not None:
        levels += mottle(background.texture, cells.pixels)
    for parts in stack:
        # Each part covers the one before it within the layer, so that coinciding rims let nothing through.
        under = levels.copy()
        for traced in parts:
            touched, covered = traced.covered(cells, index)
            own = traced.part.levels(cells.take(touched))
            levels[touched] += covered * (own - under[touched])
            under[touched] = own
    return levels
