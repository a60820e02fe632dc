"""Ring targets: which rims belong together, their common pose, and what speaks against it."""
