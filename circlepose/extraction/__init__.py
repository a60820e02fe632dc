"""From an image to the contours that may be circles' images."""
