"""The papers' experiments done again, beside the numbers that they print."""
