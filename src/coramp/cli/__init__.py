"""The command line."""

from coramp.cli.entry import main

__all__ = ["main"]
