"""What other tools call the lens models that circlepose has, and the way out for those that it lacks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.errors import CalibrationError

# Names are compared in lower case, without separators.
_PINHOLE = {
    *("pinhole", "perspective", "standard", "opencv", "opencv4", "opencv5", "opencv8", "opencv12", "opencv14"),
    *("plumbbob", "radtan", "radialtangential", "radtan4", "radtan5", "radtan8", "pinholeradtan", "pinholeradtan8"),
    *(
        "rational",
        "rationalpolynomial",
        "brown",
        "brownconrady",
        "brown5",
        "none",
        "fullopencv",
        "thinprism",
        "tilted",
    ),
}
_FISHEYE = {
    *("fisheye", "equidistant", "equi", "pinholeequi", "pinholeequidistant", "opencvfisheye", "fisheyeopencv"),
    *("kannalabrandt", "kannalabrandt4", "kannalabrandt8", "kb", "kb4", "kb8"),
}
_AGAIN = "calibrate again with a pinhole model (k1 k2 p1 p2 k3) or OpenCV's fisheye model (k1 k2 k3 k4)"
_LACKING: Mapping[str, tuple[str, str]] = {
    r"omni.*|mei|ucm|unified.*|cataomni.*|ocam.*|scaramuzza.*": ("an omnidirectional model", _AGAIN),
    r"eucm|extendedunified.*": ("the extended unified model", _AGAIN),
    r"ds|doublesphere|pinholeds": ("the double sphere model", _AGAIN),
    r"fov|atan|pinholefov": ("the field-of-view model", _AGAIN),
    r".*division.*": ("the division model", _AGAIN),
    r"cahv.*": (
        "a CAHVOR model",
        "convert it to LENSMODEL_OPENCV8 (mrcal-convert-lensmodel), or calibrate again",
    ),
    r".*spline.*": (
        "a spline model",
        "convert it to LENSMODEL_OPENCV8 (mrcal-convert-lensmodel), which loses what OpenCV's model cannot follow",
    ),
    r".*thinprismfisheye|fisheye62|fisheye624|.*fisheye.*prism.*": (
        "a fisheye model with thin prism terms",
        "without these terms, OpenCV's fisheye model loses some tenths of a px; calibrate again with it",
    ),
    r".*ftheta.*": ("the f-theta model", _AGAIN),
    r"equirectangular|latlon|lonlat|ster[ei]ographic": ("a map of directions, not the image of a lens", _AGAIN),
}


def lens_model(word: object, where: str, key: str) -> LensModel:
    """Return the model that `word` names; raises `CalibrationError`, for a model that we lack with the way out."""
    text = word if isinstance(word, str) else ""
    model, lacking = known_model(text), _lacking(text)
    if model is not None:
        return model
    if lacking is not None:
        meant, way_out = lacking
        raise CalibrationError(
            f"{where}: {key}: {shown(word)} is {meant}, which circlepose does not have; {way_out}."
        )
    raise CalibrationError(
        f"{where}: {key}: expected a pinhole model (such as plumb_bob, radtan, rational_polynomial) or a fisheye "
        f"model (such as equidistant, fisheye), got {shown(word)}; correct it."
    )


def known_model(word: str) -> LensModel | None:
    """Return the model of ours that `word` names; None where it names another, or none."""
    name = _name(word)
    return "pinhole" if name in _PINHOLE else "fisheye" if name in _FISHEYE else None


def is_lens_model(word: str) -> bool:
    """Whether `word` names a lens model: one of ours, or one that we lack."""
    return known_model(word) is not None or _lacking(word) is not None


def _lacking(word: str) -> tuple[str, str] | None:
    """Return what a model that we lack is, and the way out; None where `word` names no such model."""
    name = _name(word)
    return next((what for pattern, what in _LACKING.items() if re.fullmatch(pattern, name)), None)


def _name(word: str) -> str:
    return plain(word).removeprefix("lensmodel").removeprefix("distortion")


def pinhole_coefficients(values: Sequence[float], where: str, key: str) -> list[float]:
    """Return coefficients in OpenCV's order, in a number that OpenCV's pinhole models have.

    Trailing zeros are added (k1; k1 k2; k1 k2 p1), never a term that is not there. Raises `CalibrationError` on a
    number of coefficients that no model has.
    """
    given = list(values)
    count = next((each for each in PINHOLE_COUNTS if each >= len(given)), None)
    if count is None or 8 < len(given) < 12 or len(given) == 13:
        expected = ", ".join(map(str, PINHOLE_COUNTS))
        raise CalibrationError(
            f"{where}: {key}: expected {expected} coefficients (k1 k2 p1 p2 k3 ...), got {len(given)}."
        )
    return given + [0.0] * (count - len(given))


def plain(word: str) -> str:
    """Return a name in lower case, without separators: as names of different tools are compared."""
    return re.sub(r"[\W_]", "", word).lower()
