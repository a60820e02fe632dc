"""From an image to edge chains and arcs."""
