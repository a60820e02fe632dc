"""Random patterns that depend on the seed alone, not on the version of NumPy: mottle and camera noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import ndtri

from circlepose._typing import FloatArray
from circlepose.synthesis.scene import Texture

_PERIOD = 128
"""Lattice cells after which the mottle repeats."""
_OCTAVES = ((1.0, 1.0), (0.5, 0.5))
"""(relative size, relative amplitude) of the superposed patterns"""


def mottle(texture: Texture, points: FloatArray) -> FloatArray:
    """Return the texture's gray levels (...) at `points` (..., 2), in its unit; mean 0, twice differentiable.

    Value noise: a cubic B-spline through a lattice of uniform random numbers.
    """
    total = np.zeros(points.shape[:-1])
    for octave, (size, amplitude) in enumerate(_OCTAVES):
        at = points / (texture.scale * size) + 17.3 * octave
        table = _lattice(texture.seed, octave)
        # Rows are the second coordinate.
        where = np.mod(np.moveaxis(at[..., ::-1], -1, 0), _PERIOD)
        total += amplitude * map_coordinates(table, where, order=3, mode="grid-wrap", prefilter=False)
    return np.asarray(texture.amplitude * total)


def add_noise(image: FloatArray, sigma: float, seed: int) -> None:
    """Add Gaussian noise of `sigma` to `image` (h, w) in place.

    Uniform numbers through the inverse normal distribution: the stream of normal numbers of NumPy may
    change between versions, that of uniform ones is the bit generator's own.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    rows = max(1, (1 << 18) // image.shape[1])
    for top in range(0, image.shape[0], rows):
        block = image[top : top + rows]
        block += sigma * ndtri(generator.random(block.shape) + 2.0**-54)


@lru_cache(maxsize=16)
def _lattice(seed: int, octave: int) -> FloatArray:
    """Return the lattice (period, period), scaled for one gray level of standard deviation after smoothing."""
    generator = np.random.Generator(np.random.PCG64([seed, octave]))
    uniform = 2.0 * generator.random((_PERIOD, _PERIOD)) - 1.0
    # Mean square of a cubic B-spline's weights over the cell, per axis: 151/315.
    smoothed = np.sqrt(1.0 / 3.0) * (151.0 / 315.0)
    loudness = np.sqrt(sum(amplitude**2 for _, amplitude in _OCTAVES))
    table = (uniform - uniform.mean()) / (smoothed * loudness)
    table.setflags(write=False)
    return np.asarray(table)
