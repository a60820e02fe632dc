"""From an image to the contours that may be circles' images."""

EXTRACTIONS = ("edges", "coincidence")
"""Where contours start from: connected edges, or region borders that coincide with edges."""
