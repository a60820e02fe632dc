"""Checks of the lengths of a target: radii, generatrix and how well they are known."""

from __future__ import annotations

from itertools import pairwise

from circlepose import _arguments
from circlepose.errors import TargetError
from circlepose.targets import Kind

MAX_RADII = 16
"""Rings of a target. Each is looked for at each place where one may be and fitted with all others, so that the time
grows faster than the square of their number (16 take some seconds, 50 a minute). Printed targets have 2 to 8."""
_RADII = "radii in mm, such as (50.0, 30.0)"
_RADIUS = "a positive radius in mm (not a diameter)"


def radii(radii_mm: object, key: str = "radii_mm") -> tuple[float, ...]:
    """Return `radii_mm` as a tuple of one length or more; messages call one of them `key`."""
    parts = _arguments.parts("radii_mm", radii_mm, _RADII, TargetError)
    if not parts:
        raise TargetError(f"radii_mm: expected {_RADII}, got none.")
    return tuple(_arguments.length_mm(key, radius, _RADIUS, TargetError) for radius in parts)


def checked_radii(kind: Kind, radii_mm: object) -> tuple[float, ...]:
    """Return the radii of a target of this kind."""
    key = "radius_mm" if kind == "circle" else "radii_mm"
    found = radii(radii_mm, key)
    wanted = {"circle": "one radius", "coplanar": "two or more radii", "coaxial": "two radii"}.get(kind, "any radii")
    number = len(found)
    enough = {"circle": number == 1, "coplanar": number >= 2, "coaxial": number == 2}.get(kind, True)
    if not enough:
        raise TargetError(f"{key}: a target of kind {kind} has {wanted}, got {number}.")
    if number > MAX_RADII:
        raise TargetError(
            f"{key}: a target has at most {MAX_RADII} radii, got {number}; leave out the least visible ones."
        )
    if any(a <= b for a, b in pairwise(found)):
        order = ", ".join(f"{r:g}" for r in found)
        raise TargetError(
            f"{key}: expected the outer radius first and each next one smaller, got [{order}]; "
            "inner and outer may be swapped or equal."
        )
    return found


def check_generatrix(kind: Kind, radii_mm: tuple[float, ...], generatrix_mm: object) -> None:
    """Raise `TargetError` where no target of these circles has this rim to rim distance."""
    if kind != "coaxial":
        raise TargetError(f"generatrix_mm: only a coaxial target has one, this one is {kind}.")
    shortest = radii_mm[0] - radii_mm[1]
    length = _arguments.length_mm("generatrix_mm", generatrix_mm, "a positive length in mm", TargetError)
    if length <= shortest:
        raise TargetError(
            f"generatrix_mm: must be longer than the difference of the radii ({shortest:g} mm), got {length:g}."
        )


def check_sigma(key: str, sigma_mm: object, radius_mm: float) -> None:
    """Raise `TargetError` where `sigma_mm` is no standard deviation of a length of a target of this radius."""
    expected = f"a standard deviation in mm, 0 or more and less than the radius of {radius_mm:g} mm"
    sigma = _arguments.number(key, sigma_mm, expected, TargetError)
    if not 0.0 <= sigma < radius_mm:
        raise TargetError(f"{key}: expected {expected}, got {sigma:g}.")
