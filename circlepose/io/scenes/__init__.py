"""Scene files, and the folders that are rendered from them."""
