"""What moves the vehicles."""
