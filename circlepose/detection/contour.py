"""What extraction hands on: the contours kept, with why, and those rejected, with why not."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from circlepose._typing import FloatArray
from circlepose.geometry.conic import Ellipse
from circlepose.targets import Polarity

WANTED_SIGN: dict[Polarity, int] = {"any": 0, "dark": 1, "bright": -1}
"""Sign of `Contour.polarity` that each wish admits; 0 admits both."""


class Rejection(StrEnum):
    """Why a contour was not used."""

    TOO_SHORT = "too short for a circle of the sizes looked for"
    NOT_ELLIPTICAL = "no ellipse fits it"
    MAJOR_AXIS = "major axis outside its interval"
    MINOR_AXIS = "minor axis outside its interval"
    TOO_LITTLE_RIM = "too little of the ellipse's rim stands on an edge"
    WEAK_EDGE = "edge hardly above the noise"
    RAGGED = "edge departs too far from an ellipse"
    UNLIKE_A_RIM = "edge strays and varies more than the rim of a circle so small"
    POLARITY = "brighter or darker inside than asked for"
    DUPLICATE = "same edge as a contour kept"
    INSIDE_ANOTHER = "concentric with and inside a larger contour"
    DEPTH = "depth outside its range"
    NO_POSE = "what is seen of its rim settles no pose"
    BEYOND_COUNT = "more than --count, with less evidence"
    NOT_IN_TARGET = "belongs to no complete target"


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """A contour that is taken for the rim of a circle's image."""

    points: FloatArray
    """(n, 2) px, sub-pixel, in order around the rim; places without an edge are left out"""
    ellipse: Ellipse
    """fitted in the raw image"""
    polarity: int
    """+1: darker inside, -1: brighter inside"""
    step: float
    """height of the edge, grey levels"""
    rim_used: float
    """share of the rim that stands on the edge, 0 to 1"""
    residual_px: float
    """rms distance of the points from the ellipse"""
    evidence: float
    """what contours are ranked by: edge height summed along the rim, less for a ragged one"""
    score: float
    """how surely it is a circle's rim, 0 to 1: `rim_used`, less where the edge strays or varies"""

    @property
    def kept_because(self) -> str:
        """One line for a person."""
        side = "darker" if self.polarity > 0 else "brighter"
        return (
            f"{self.rim_used:.0%} of its rim on an edge of {self.step:.0f} levels, {side} inside, "
            f"{self.residual_px:.2f} px from an ellipse, score {self.score:.2f}"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Extraction:
    """All contours of one image: those kept, most evidence first, and how many were rejected why."""

    contours: tuple[Contour, ...]
    rejected: Counter[Rejection]
    refused: Ellipse
    """(batch) those rejected of which the edge was looked at closely, most evidence first"""
    refused_why: tuple[Rejection, ...]
    is_complete: bool
    """whether the search went on to the smallest circles, and did not end with as many as were asked for"""
