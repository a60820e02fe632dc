"""Calibration files, a form a module: each recognizes its files by their content and reads one camera of them."""
