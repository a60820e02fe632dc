"""Calibration files to a camera: a module a form."""
