"""Text in files: checked forms, names, YAML."""
