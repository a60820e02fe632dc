"""What is looked for: circles, ring targets and boards, and what is known of them beforehand."""

from typing import Literal, TypeAlias, get_args

Kind = Literal["circle", "coplanar", "coaxial", "board"]
Polarity = Literal["any", "dark", "bright"]
KINDS: tuple[Kind, ...] = get_args(Kind)
POLARITIES: tuple[Polarity, ...] = get_args(Polarity)
SamePlane = Literal["auto", "yes", "no"]
SAME_PLANE: tuple[SamePlane, ...] = get_args(SamePlane)

Direction: TypeAlias = tuple[float, float, float]
Side = Literal["left", "right", "up", "down"]
SIDES: dict[Side, Direction] = {
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "up": (0.0, -1.0, 0.0),
    "down": (0.0, 1.0, 0.0),
}
"""Unit vectors (3,) in the camera frame."""
