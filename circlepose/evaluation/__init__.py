"""Tables of poses held against each other, or against the truth."""
