"""Many images: one after the other, in input order."""
