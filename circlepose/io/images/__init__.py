"""Image files to arrays, or a status that says why not."""
