"""Tables of poses held against each other, or against the truth."""

from typing import Literal

CandidateChoice = Literal["chosen", "best"]
"""Which candidate is compared: the chosen one, or the nearest to the reference."""
