"""The command line."""

from coramp.cli.commands import main

__all__ = ["main"]
