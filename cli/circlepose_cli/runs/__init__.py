"""The commands at work."""
