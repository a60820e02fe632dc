"""From a viewing cone or a contour to the candidate poses. A solver returns all solutions and ranks none."""

from typing import Literal, get_args

from circlepose.errors import ArgumentError

CircleMethod = Literal["chen-huang", "chen-huang-contour", "kanatani-liu", "kabuka-arenas"]
Method = Literal[CircleMethod, "fu-zhou"]
CIRCLE_METHODS: tuple[CircleMethod, ...] = get_args(CircleMethod)
"""Names of the methods for a single circle."""
FU_ZHOU = "fu-zhou"
"""Name of the method for two circles of a ring target; see `rings.fu_zhou_route`."""
METHODS: tuple[Method, ...] = get_args(Method)
"""Names of the methods, as on the command line and in the table's `method` column."""


def methods_for(kind: str, method: str) -> tuple[str, ...]:
    """Return the methods that `method`, one of `METHODS` or `all`, means for a target of `kind`.

    Raises `ArgumentError` where it is none, or cannot measure such a target.
    """
    if kind == "board":
        if method not in ("all", CIRCLE_METHODS[0]):
            raise ArgumentError(
                f"method: a board's pose is fitted to the rims of all its circles; leave out {method}."
            )
        return CIRCLE_METHODS[:1]
    known = CIRCLE_METHODS if kind == "circle" else METHODS
    if method == "all":
        return known
    if method not in METHODS:
        raise ArgumentError(f"method: expected all or one of {', '.join(METHODS)}, got {method!r}.")
    if method not in known:
        raise ArgumentError(
            f"method: {method} needs a ring target, kind: coplanar or coaxial, got kind: {kind}; for a lone circle "
            f"use all or one of {', '.join(CIRCLE_METHODS)}."
        )
    return (method,)
