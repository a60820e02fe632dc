"""Images and outputs at URLs."""
