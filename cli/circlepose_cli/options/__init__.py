"""What is typed, checked and put together: options, overrides, camera and target."""
