"""From two candidate poses to one, where something in the scene tells."""
