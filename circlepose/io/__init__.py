"""All that touches the disk: images, calibration, targets, tables."""
