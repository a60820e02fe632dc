"""Exact geometry of circles, ellipses and viewing cones. NumPy only; no pixels, no camera."""
