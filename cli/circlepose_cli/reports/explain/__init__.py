"""The report on one image: as text, and as JSON."""
