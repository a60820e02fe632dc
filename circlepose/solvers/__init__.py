"""From a viewing cone or a contour to the candidate poses. A solver returns all solutions and ranks none."""

METHODS = ("chen-huang", "chen-huang-contour", "kanatani-liu", "kabuka-arenas")
"""Names of the methods, as on the command line and in the table's `method` column."""
