"""Makes the pages of the documentation site that come from the program, its files and its pictures."""
