"""Whether an image of another size than the calibration's can be the whole image, resized."""

from __future__ import annotations

Size = tuple[int, int]
"""(width, height) px"""

_ROUNDING_PX = 1.0
"""A resized image has whole pixels: each of its sides is off by less than this."""
_EVEN_PX = 2.0
"""The same where an encoder asks for even sides."""


def is_resized(size: Size, original: Size) -> bool:
    """Whether an image of `size` can be the whole of `original`, resized by one factor and rounded to pixels.

    A crop of the same proportions cannot be distinguished from it.
    """
    if size == original:
        return True
    # A resized side changes by more than rounding does: where one stays, a piece of the other was cut off.
    if size[0] == original[0] or size[1] == original[1]:
        return False
    small, large = sorted((size, original), key=lambda each: each[0] * each[1])
    rounding = _EVEN_PX if small[0] % 2 == 0 and small[1] % 2 == 0 else _ROUNDING_PX
    least = max((side - rounding) / whole for side, whole in zip(small, large, strict=True))
    most = min((side + rounding) / whole for side, whole in zip(small, large, strict=True))
    return least < most


def size_mismatch(size: Size, calibrated: Size, *, scaled: bool = False) -> str | None:
    """Return what an image of `size` looks like beside a calibration for another size, and what to do, or None.

    With `scaled` it is said to be the whole image, resized; where it can be that, None is returned.
    """
    is_whole = is_resized(size, calibrated)
    if size == calibrated or (scaled and is_whole):
        return None
    start = f"the image is {size[0]} x {size[1]} px, the calibration holds for {calibrated[0]} x {calibrated[1]}"
    if is_whole:
        insist = "set scale_calibration if the whole image was resized, not cropped"
        return f"{start}; use the right calibration, or {insist}"
    if is_resized(size, calibrated[::-1]):
        return f"{start}: it looks turned by 90 deg; use the image as the camera stored it, or calibrate turned ones"
    return (
        f"{start}, which has other proportions: it looks cropped, or taken in another mode of the camera; use the "
        "whole image, or state the part's size in the calibration and take its left and top off cx and cy"
    )
