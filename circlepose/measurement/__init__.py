"""From a contour to a measured rim, and from it to the poses of each method."""
