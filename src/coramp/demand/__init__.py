"""Who arrives when."""
