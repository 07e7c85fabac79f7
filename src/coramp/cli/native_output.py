"""Keeps what native libraries print away from what coramp prints."""

import os
import sys

STDOUT, STDERR = 1, 2


def send_native_output_to_stderr() -> None:
    """Has everything that does not go through Python's ``sys.stdout`` go to stderr.

    HiGHS now and then prints a line of its own, which would end up in the middle of JSON. For a
    whole program, processes that it starts included; nothing happens where stdout is no file.
    """
    try:
        if sys.stdout.fileno() != STDOUT:
            return
        sys.stdout.flush()
        kept = os.dup(STDOUT)
        os.dup2(STDERR, STDOUT)
    except (OSError, ValueError, AttributeError):  # closed, or replaced by what is no file
        return
    sys.stdout = open(  # noqa: SIM115, PTH123 - a descriptor, for as long as the program runs
        kept, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors
    )
