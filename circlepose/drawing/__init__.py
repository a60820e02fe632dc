"""Pictures of results. Nothing here measures."""
