"""What a module of `writers/` has to offer, and what it is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from circlepose.camera.camera import Camera, LensModel
from circlepose.io.calibration.writers import WrittenForm

SKEW, SIGMA, TARGET, NAME = "skew", "sigma", "target", "name"
"""what a form may hold besides focal lengths, principal point, lens and image size"""


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens model of a form."""

    name: str
    """as the form calls it"""
    model: LensModel
    count: int
    """of its coefficients, which are the first ones of ours, in OpenCV's order"""


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """What goes into a file; the form holds all of it exactly."""

    camera: Camera
    """with as many coefficients as `lens` has, and without a sigma where the form has no place for it"""
    lens: Lens
    name: str = ""
    """of the camera; empty where it has none"""
    target: Mapping[str, object] | None = None
    """keys and values of the target to be measured"""
    ending: str = ""
    """of the file's name, such as `.xml`; empty on standard output"""

    @property
    def size(self) -> tuple[int, int]:
        """The image's (width, height) px, of a form that needs it."""
        assert self.camera.image_size is not None
        return self.camera.image_size

    @property
    def focal_and_center(self) -> tuple[float, float, float, float]:
        """The focal lengths and the principal point: fx, fy, cx, cy, px."""
        (fx, _, cx), (_, fy, cy), _ = self.camera.camera_matrix.tolist()
        return fx, fy, cx, cy


@dataclass(frozen=True, slots=True)
class Writer:
    """One kind of calibration file that is written."""

    key: WrittenForm
    name: str
    """that of the reader's form"""
    lenses: tuple[Lens, ...]
    """of each model, those of fewer coefficients first"""
    endings: tuple[str, ...]
    """of names of such files"""
    text: Callable[[Contents], str]
    """Returns the whole file."""
    holds: frozenset[str] = frozenset()
    """which of SKEW, SIGMA, TARGET and NAME"""
    needs_size: bool = True
    """whether a file without the image's size is none"""
    refusal: Callable[[Contents], str | None] = lambda _: None
    """Returns why the tool would not take a camera, as the end of a sentence."""
    remarks: Callable[[Contents], tuple[str, ...]] = lambda _: ()
    """Returns what was converted or filled in, for a person."""
