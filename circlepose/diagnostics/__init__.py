"""What an image and its poses rest on: data, without drawing."""
