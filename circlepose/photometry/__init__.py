"""From the gray levels around a rim to its viewing cone."""
