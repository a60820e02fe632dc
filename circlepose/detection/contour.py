"""The result of detection: the contours kept, with why, and those rejected, with why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from circlepose._batching import joined
from circlepose._typing import FloatArray
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets import Polarity

WANTED_SIGN: dict[Polarity, int] = {"any": 0, "dark": 1, "bright": -1}
"""Sign of `Contour.polarity` that each value of a target admits; 0 admits both."""


class Rejection(StrEnum):
    """Why a contour was not used."""

    TOO_SHORT = "too short for a circle of the sizes looked for"
    NOT_ELLIPTICAL = "no ellipse fits it"
    MAJOR_AXIS = "major axis outside its interval"
    MINOR_AXIS = "minor axis outside its interval"
    TOO_LITTLE_RIM = "too little of the ellipse's rim stands on an edge"
    WEAK_EDGE = "edge hardly above the noise"
    FAINT = "much fainter than other circles, and small or seen in part"
    BLURRED = "edge too blurred to be located"
    RAGGED = "edge departs too far from an ellipse"
    POLYGON = "edge has corners at equal angles, as a polygon's"
    HOLLOW = "the middle is as bright as the surroundings, as in a ring or a letter"
    BY_CHANCE = "round by chance: most shapes of its size around it are not"
    WITHOUT_EDGE = "a blob without an edge"
    UNLIKE_A_RIM = "edge strays and varies more than the rim of a circle so small"
    POLARITY = "brighter or darker inside than asked for"
    DUPLICATE = "same edge as a contour kept"
    INSIDE_ANOTHER = "concentric with and inside a larger contour"
    WORLD_BOARD = "a circle of the world board"
    DEPTH = "depth outside its range"
    NO_POSE = "what is seen of its rim settles no pose"
    BEYOND_COUNT = "more than --count, with less evidence"
    NOT_IN_TARGET = "belongs to no complete target"
    RESIDUAL = "edges farther from an ellipse than --max-residual-px"
    LOW_SCORE = "score below --min-score"
    TOO_SMALL = "smaller than is looked for"
    BUDGET = "not tried again: more doubtful contours than the time for one image allows"


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """A contour that may be the rim of a circle's image."""

    points: FloatArray
    """(n, 2) px, sub-pixel, in order around the rim; samples without an edge are left out"""
    ellipse: Ellipse
    """fitted in the raw image"""
    polarity: int
    """+1: darker inside, -1: brighter inside"""
    step: float
    """height of the edge, gray levels"""
    rim_used: float
    """share of the rim that lies on the edge, 0 to 1"""
    residual_px: float
    """rms distance of the points from the ellipse"""
    evidence: float
    """levels x px; contours are ranked by it: edge height summed along the rim, less for a ragged one"""
    score: float
    """confidence that it is a circle's rim, 0 to 1: `rim_used`, less where the edge strays or varies"""
    noise_px: float = 0.0
    """about the scatter of an edge by noise"""
    ragged: float = 0.0
    """scatter of the edges beyond noise, over the largest that pixels and lens explain: above 1 the rim is rough"""
    blur_px: float = 0.0
    """about the blur of the edge, where it was located in a reduced image; 0 where in the full one"""
    nested: tuple[Contour, ...] = ()
    """those inside it of the same center, largest first, where one could be taken for it: see `nested_in`"""
    color_mix: Mapping[str, float] | None = None
    """weights by channel of the color mix in which it was found; None for the gray levels"""

    @property
    def kept_because(self) -> str:
        """One line for a person."""
        side = "darker" if self.polarity > 0 else "brighter"
        return (
            f"{self.rim_used:.0%} of its rim on an edge of {self.step:.0f} levels, {side} inside, "
            f"{self.residual_px:.2f} px from an ellipse, score {self.score:.2f}"
        ) + ("" if self.color_mix is None else f", in the mix {mix_in_words(self.color_mix)}")


def mix_in_words(color_mix: Mapping[str, float]) -> str:
    """Return the weights of a color mix for a person."""
    return " ".join(f"{weight:+.2f} {channel}" for channel, weight in color_mix.items())


@dataclass(frozen=True, slots=True, eq=False)
class DetectionResult:
    """All contours of one image: those kept, most evidence first, and how many were rejected for which reason."""

    contours: tuple[Contour, ...]
    rejected: Counter[Rejection]
    """number of contours by reason; not to be changed"""
    refused: Ellipse
    """(batch) those rejected after the edges along them were located, most evidence first"""
    refused_why: tuple[Rejection, ...]
    """their reasons, in the same order"""
    is_complete: bool
    """whether the search went on to the smallest circles; else it ended with as many as were asked for"""

    def without(self, dropped: Iterable[Contour], reason: Rejection) -> DetectionResult:
        """Return the same with the contours `dropped` rejected for that `reason`."""
        out = list(dropped)
        if not out:
            return self
        # Contours compare by identity.
        left_out = set(out)
        return replace(
            self,
            contours=tuple(contour for contour in self.contours if contour not in left_out),
            rejected=self.rejected + Counter({reason: len(out)}),
            refused=joined([Ellipse.batch([contour.ellipse for contour in out]), self.refused]),
            refused_why=(reason,) * len(out) + self.refused_why,
        )
