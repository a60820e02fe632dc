"""Which pixels about rims tell something: not those that are clipped, nor where something hides or touches a rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from circlepose._batching import rows
from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.photometry.gauss_newton import Seen
from circlepose.photometry.intensity_model import Levels
from circlepose.photometry.occlusion import ZONES, cells_of, unlike_others
from circlepose.photometry.pixel_band import Bands

_STRETCH_PX = 8.0
_STRETCHES = (12, 72)


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """The pixels about m rims, k each, before any of them is left out."""

    given: BoolArray
    """(m, k) which are no padding"""
    dark: BoolArray
    """(m, k) clipped from below"""
    light: BoolArray
    """(m, k) and from above"""
    levels: RealArray
    """(m, k) less of what others add"""
    added: RealArray
    """(m, k) that is, of other rims close by"""
    stretches: IntArray
    """(m,) in which each rim is cut"""
    limits: tuple[float, float]

    @classmethod
    def of(
        cls, bands: Bands, perimeter_px: FloatArray, limits: tuple[float, float], beside: RealArray | None
    ) -> Self:
        """Return those of `bands`, see `photometric.fit_to_levels`."""
        added = np.zeros_like(bands.levels) if beside is None else beside
        return cls(
            given=bands.weight > 0.0,
            dark=bands.levels <= limits[0],
            light=bands.levels >= limits[1],
            levels=bands.levels - added,
            added=added,
            stretches=np.clip(perimeter_px / _STRETCH_PX, *_STRETCHES).astype(np.int64),
            limits=limits,
        )

    def telling(
        self, which: IntArray | slice, seen: Seen, state: Levels, weight: RealArray
    ) -> tuple[RealArray, BoolArray, IntArray]:
        """Return the weights (n, k) of the pixels of the rims `which`, what is left out, and the pixels' stretches.

        From how the m rims are `seen`, with the levels of that `state` and the `weight` (m, k) in use so far. What is
        left out is (n, stretches, zones), see `unlike`.
        """
        most = int(self.stretches.max())
        own = rows(self, which)
        plane, distance_px, sigma_px = rows((seen.at.plane, seen.at.distance_px, np.exp(seen.blur[:, 0])), which)
        model, contrast, in_use = rows((state.model, state.contrast, weight), which)
        shape = (len(own.stretches), most, ZONES)
        cells = cells_of(plane, distance_px, sigma_px, own.stretches, shape)
        # A clipped level tells only where the model would have it on this side of the clip.
        low, high = self.limits
        tells = own.given & ~((own.light & (model + own.added >= high)) | (own.dark & (model + own.added <= low)))
        left_out = unlike_others(model - own.levels, tells, in_use, cells, contrast, shape)
        return (tells & ~left_out.ravel()[cells]).astype(weight.dtype), left_out, (cells // ZONES) % most
