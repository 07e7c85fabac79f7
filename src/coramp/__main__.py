"""``python -m coramp``: the command line."""

from coramp.cli import main

main()
