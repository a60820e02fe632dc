"""From what was typed to the images that it stands for."""
