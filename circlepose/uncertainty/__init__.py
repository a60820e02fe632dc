"""The covariance of a pose, term by term."""
