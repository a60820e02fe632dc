"""The viewing cone of a circle as measured: a cone with the covariance of its five modes. Pure NumPy."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from circlepose import _arguments
from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import ConeKind, principal_frame
from circlepose.geometry.cone_perturbation import pose_coefficients

_NORMAL = "a unit vector, three numbers in the camera frame"
_UNIT = 1e-3
"""How far the length of a unit vector may be from 1: a rounded one of a table is."""


@dataclass(frozen=True, slots=True, eq=False)
class Cone:
    """The viewing cone of a circle, as its rim alone was measured: what boards and calibration start from.

    The rays of the rim are `factor @ (cos p, sin p, 1)`. A cone close to it has a rim that is larger at the angle p
    by m0 + m1 cos p + m2 sin p + m3 cos 2p + m4 sin 2p, as a share of the radius: these are its five modes. The
    measured cone has the modes 0, with the covariance `modes_covariance`.
    """

    factor: FloatArray
    """(3, 3) camera frame; the columns are the semi-axes and the middle of a section of the cone"""
    kind: ConeKind
    """viewing condition, by the error of the edges"""
    modes_covariance: FloatArray | None = None
    """(5, 5) of the modes m0 to m4, no unit; of the image's noise alone. None where only edges were measured"""

    def modes_of(self, center: FloatArray, normal: FloatArray, radius_mm: float) -> FloatArray:
        """Return the modes (5,) by which the cone of a circle departs from this one.

        Parameters
        ----------
        center, normal
            (3,) of the circle, camera frame: mm, and a unit vector.
        radius_mm
            Its radius.

        Raises
        ------
        ArgumentError
            On what is no circle.
        """
        center_ = np.array(_arguments.numbers("center", center, "three numbers in mm, camera frame", 3))
        unit = np.array(_arguments.numbers("normal", normal, _NORMAL, 3))
        if not abs(math.hypot(*unit) - 1.0) < _UNIT:
            raise ArgumentError(f"normal: expected {_NORMAL}, got {_arguments.shown(normal)}.")
        radius = _arguments.length_mm("radius_mm", radius_mm, "a positive radius in mm")
        return pose_coefficients(self.factor, center_, unit, radius)

    def __eq__(self, other: object) -> bool:
        # `CircleResult.cone` was a ConeKind once.
        if isinstance(other, str):
            warnings.warn("CircleResult.cone is a Cone; compare cone_kind", DeprecationWarning, stacklevel=2)
            return self.kind == other
        return self is other

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        half_angles = ", ".join(f"{math.degrees(angle):.3f}" for angle in self._half_angles())
        known = "" if self.modes_covariance is None else ", with covariance"
        return f"Cone({self.kind}, half angles ({half_angles}) deg{known})"

    def _half_angles(self) -> tuple[float, float]:
        """Return half the largest apex angle and half that across it, rad."""
        frame = principal_frame(self.factor)
        return math.atan(float(frame.tan_half_major)), math.atan(float(frame.tan_half_minor))
