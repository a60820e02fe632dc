"""From an image to samples of it: gray levels, halved sizes, edges to sub-pixel."""
