"""The process at a terminal: streams, signals, progress."""
