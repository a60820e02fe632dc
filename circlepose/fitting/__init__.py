"""From a contour to the ellipse, or the viewing cone, that fits it."""
