"""Boards of circles: which circle is which, and one rigid pose from all of them."""
