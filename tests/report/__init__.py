"""Pictures, from the data that is drawn."""
