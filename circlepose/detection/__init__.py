"""From an image to the contours that may be circles' images."""

from typing import Literal, get_args

Extraction = Literal["edges", "coincidence"]
EXTRACTIONS: tuple[Extraction, ...] = get_args(Extraction)
"""Where contours start from: connected edges, or region borders that coincide with edges."""
