"""What is looked for: circles and ring targets, and what is known of them beforehand."""
