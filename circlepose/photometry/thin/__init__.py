"""Rims so thin that the blur runs their two sides together."""
