"""Which lens model of a form holds a camera exactly, and how far the nearest is off where none does."""

from __future__ import annotations

from collections.abc import Iterable

from circlepose.camera.approximation import WIDEST_DEG, Approximation, approximate
from circlepose.camera.camera import Camera
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.errors import CalibrationError
from circlepose.io.calibration.keys import COEFFICIENTS
from circlepose.io.calibration.writers.writer import SKEW, Lens, Writer


def exact_lens(camera: Camera, writer: Writer) -> Lens | None:
    """Return the lens model of a form that holds a camera: the one of as many coefficients, or one that adds zeros.

    Coefficients at the end that are 0 may be left out. None where the form has no such model, or no skew.
    """
    if camera.camera_matrix[0, 1] and SKEW not in writer.holds:
        return None
    counts = [len(camera.dist_coeffs), _needed_count(camera)]
    lenses = [each for each in writer.lenses if each.model == camera.model and each.count >= counts[1]]
    same = [each for each in lenses if each.count == counts[0]]
    return next(iter((*same, *lenses)), None)


def refusal(camera: Camera, writer: Writer, others: Iterable[Writer], where: str) -> CalibrationError:
    """Return the sentence for a camera that a form does not hold: its model, the nearest one, and who holds it."""
    holding = [f"--to {each.key}" for each in others if exact_lens(camera, each) is not None]
    hold = f"{holding[0]} holds" if len(holding) == 1 else f"{', '.join(holding[:-1])} and {holding[-1]} hold"
    return CalibrationError(
        f"{where}: {writer.name} cannot hold {_described(camera)} exactly; {_residual(camera, writer)}; {hold} it "
        "exactly."
    )


def _needed_count(camera: Camera) -> int:
    """Return the number of coefficients of the smallest of our models that holds those of a camera."""
    if camera.model == "fisheye":
        return len(camera.dist_coeffs)
    return next(count for count in PINHOLE_COUNTS if not camera.dist_coeffs[count:].any())


def _described(camera: Camera) -> str:
    count = _needed_count(camera)
    if camera.model == "fisheye":
        model = "a fisheye lens (k1 k2 k3 k4)"
    elif count == 0:
        model = "a pinhole camera"
    else:
        model = f"a pinhole lens of {count} coefficients (up to {_last_term(camera)})"
    skew = float(camera.camera_matrix[0, 1])
    return f"{model} with a skew of {skew:.3g} px" if skew else model


def _last_term(camera: Camera) -> str:
    return COEFFICIENTS[int(camera.dist_coeffs.nonzero()[0][-1])]


def _residual(camera: Camera, writer: Writer) -> str:
    """Return how far the nearest model of a form is off, as a part of a sentence."""
    if camera.image_size is None:
        return "how far its nearest model is off cannot be said, as the calibration states no image size"
    largest = {each.model: each for each in writer.lenses}
    found: list[tuple[Approximation, Lens]] = []
    for each in largest.values():
        fit = approximate(camera, each.model, each.count)
        if fit is not None:
            found.append((fit, each))
    if not found:
        return "none of its models reaches enough of the image to be compared"
    fit, lens = min(found, key=lambda pair: (-round(pair[0].share, 2), pair[0].rms_px))
    over = "the image"
    if fit.share < 1.0:
        where = (
            f"within {WIDEST_DEG:g} deg of the axis" if lens.model != camera.model else "that the lens model reaches"
        )
        over = f"the {100.0 * fit.share:.0f} % of the image {where}"
    return (
        f"its nearest model, {lens.name}, is off by {fit.rms_px:.2g} px rms and {fit.max_px:.2g} px at most over "
        f"{over}"
    )
