"""From log odds to a probability. Pure NumPy: importing `scipy.special` takes longer than all the rest."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray


def logistic(log_odds: FloatArray | float) -> FloatArray:
    """Return 1 / (1 + exp(-x)) of log odds x (...), which are free to be large."""
    small = np.exp(-np.abs(log_odds))
    return np.asarray(np.where(np.less(log_odds, 0.0), small, 1.0) / (1.0 + small))
