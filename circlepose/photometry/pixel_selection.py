"""The selection of pixels for a fit: without clipped pixels, and without cells that are outliers.

A clipped pixel is an inequality constraint: it is used where the model is within the range, and has no weight where
the model is beyond the clipped level. Outliers are those of `occlusion`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import rows
from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.photometry.gauss_newton import Linearization
from circlepose.photometry.intensity_model import FittedLevels
from circlepose.photometry.occlusion import outlier_cells
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.segments import ZONES, cell_indices


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """The pixels around m rims, k each, before the selection."""

    is_valid: BoolArray
    """(m, k) no padding"""
    is_dark: BoolArray
    """(m, k) clipped at the lower limit"""
    is_bright: BoolArray
    """(m, k) clipped at the upper limit"""
    levels: RealArray
    """(m, k) measured, less `neighbors`"""
    neighbors: RealArray
    """(m, k) levels that other rims close by add"""
    segments: IntArray
    """(m,) of each rim"""
    limits: tuple[float, float]
    """levels at which the image is clipped"""

    @classmethod
    def of(
        cls,
        bands: Bands,
        perimeter_px: FloatArray,
        limits: tuple[float, float],
        neighbors: RealArray | None,
        *,
        options: PhotometryOptions = DEFAULT,
    ) -> Self:
        """Return the pixels of `bands`; parameters as of `fit.fit_to_levels`."""
        added = np.zeros_like(bands.levels) if neighbors is None else neighbors
        number = (options.least_segments, options.most_segments)
        return cls(
            is_valid=bands.weight > 0.0,
            is_dark=bands.levels <= limits[0],
            is_bright=bands.levels >= limits[1],
            levels=bands.levels - added,
            neighbors=added,
            segments=np.clip(perimeter_px / options.segment_px, *number).astype(np.int64),
            limits=limits,
        )

    def select(
        self,
        which: IntArray | slice,
        linearization: Linearization,
        fitted: FittedLevels,
        weight: RealArray,
        *,
        options: PhotometryOptions = DEFAULT,
    ) -> tuple[RealArray, BoolArray, IntArray]:
        """Return weights (n, k), outlier cells (n, segments, zones) and each pixel's segment (n, k).

        Parameters
        ----------
        which
            The n of m rims to select pixels of.
        linearization, fitted
            The model and the levels of the m rims.
        weight
            (m, k) weights in use so far.
        options
            Tunable numbers.
        """
        most = int(self.segments.max())
        own = rows(self, which)
        at = linearization.coordinates
        plane, distance_px, sigma_px = rows((at.plane, at.distance_px, np.exp(linearization.blur[:, 0])), which)
        model, contrast, in_use = rows((fitted.model, fitted.contrast, weight), which)
        shape = (len(own.segments), most, ZONES)
        cells = cell_indices(plane, distance_px, sigma_px, own.segments, shape, options=options)
        low, high = self.limits
        is_beyond = (own.is_bright & (model + own.neighbors >= high)) | (own.is_dark & (model + own.neighbors <= low))
        is_informative = own.is_valid & ~is_beyond
        outliers = outlier_cells(model - own.levels, is_informative, in_use, cells, contrast, shape, options=options)
        selected = (is_informative & ~outliers.ravel()[cells]).astype(weight.dtype)
        return selected, outliers, (cells // ZONES) % most
