"""Where circles lie that share no plane: the alternative that a plane has to beat. Pure NumPy.

Both candidates of a circle are tilted alike from the line of sight, so the tilts that occur in an image are known
before any candidate is chosen, and so is the range of distances. Circles that all nearly face the camera agree in
their normals more often by chance, and need more evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.disambiguation.observed import Observed


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """Normals by their tilts from the line of sight, heights uniform in a range."""

    log_densities: FloatArray
    """(m,) of each circle's normal and height, rad^-2 mm^-1"""
    mean_lean: float
    """mean of 1 - cos(tilt)"""
    depth_mm: float
    """range of heights"""

    def of_planes(self, normals: FloatArray, points: FloatArray) -> FloatArray:
        """Return the log densities (h,) of planes with normals and points (h, 3)."""
        return _log_density(_leans(normals, points), self.mean_lean, self.depth_mm)

    def subset(self, index: slice) -> Background:
        """Return the same for the circles of `index`."""
        return Background(self.log_densities[index], self.mean_lean, self.depth_mm)


def background_of(circles: Observed) -> Background:
    """Return where m circles lie by their tilts and distances alone; m is 2 or more."""
    leans = _leans(circles.normals, circles.centers).mean(axis=1)
    distances = np.linalg.norm(circles.centers, axis=-1).mean(axis=1)
    number = len(leans)
    # The range of a uniform distribution is that of a sample and a little more.
    spread = float(np.ptp(distances)) * (number + 1.0) / (number - 1.0)
    noise = float(np.sqrt(12.0 * np.median(circles.covariances[..., 2, 2])))
    depth_mm = float(np.hypot(spread, noise))
    mean_lean = float(np.clip(leans.mean(), np.median(circles.covariances[..., 0, 0]), 1.0))
    return Background(_log_density(leans, mean_lean, depth_mm), mean_lean, depth_mm)


def _leans(normals: FloatArray, points: FloatArray) -> FloatArray:
    """Return 1 - cos(tilt) (...) of normals from the lines of sight of points (..., 3)."""
    return 1.0 + np.sum(normals * points, axis=-1) / np.linalg.norm(points, axis=-1)


def _log_density(leans: FloatArray, mean_lean: float, depth_mm: float) -> FloatArray:
    """Even odds of an exponential distribution of 1 - cos(tilt) and of all directions of the half sphere."""
    per_direction = 0.5 * (np.exp(-leans / mean_lean) / mean_lean + 1.0) / (2.0 * np.pi)
    return np.log(per_direction / depth_mm)
