"""The commands: their signatures. They import nothing heavy."""
