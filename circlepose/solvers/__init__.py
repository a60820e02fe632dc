"""From a viewing cone or a contour to the candidate poses. A solver returns all solutions and ranks none."""
