"""Finished documents for people, made of results."""
