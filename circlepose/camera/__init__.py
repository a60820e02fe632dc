"""The calibrated camera: lens models, projection, and what a calibration cannot mean."""
