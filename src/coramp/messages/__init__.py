"""What world and coordinator tell each other, the channel between them, and the log of it."""
