"""Results as tables, and tables read back."""
