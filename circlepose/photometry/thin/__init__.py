"""Rims so thin that the blur joins their two sides."""
