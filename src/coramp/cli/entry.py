"""The program: runs a command, and turns what goes wrong into a line and an exit code."""

import atexit
import gc
import sys
from typing import NoReturn

import typer

from coramp.cli.commands import app
from coramp.cli.native_output import send_native_output_to_stderr
from coramp.cli.options import DEBUG, STOPPED, USAGE, WRONG
from coramp.errors import CorampError, printable

LOOKS_AFTER = 50_000
"""How many objects are new before Python looks for those that are no longer needed."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Runs the command line and exits: 0 fine, 1 wrong value or failed run, 2 usage, 3 unsafe."""
    given = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    debug = DEBUG in given
    if arguments is None:
        _collect_seldom()
        send_native_output_to_stderr()
    try:
        code = app([word for word in given if word != DEBUG], standalone_mode=False)
    except Exception as error:
        if debug:
            raise
        sys.exit(_report(error))
    except KeyboardInterrupt:
        sys.exit(_stopped())
    sys.exit(_stopped() if code == STOPPED else code if isinstance(code, int) else 0)


def _collect_seldom() -> None:
    """Has Python seldom look for what is no longer needed, and not at all at its end.

    Nearly all that a command imports stays until then: half a second of looking finds nothing.
    """
    gc.set_threshold(LOOKS_AFTER)
    atexit.register(gc.freeze)


def _stopped() -> int:
    """Says that the user stopped it; returns the exit code."""
    print("Error: stopped; start again to go on where this left off", file=sys.stderr)
    return STOPPED


def _report(error: Exception) -> int:
    """Prints an error in one line for each of its messages; returns the exit code."""
    match error:
        case CorampError():
            code, messages = WRONG, error.messages
        case typer.BadParameter() if not hasattr(error, "param_type"):  # that is a missing one
            code, messages = WRONG, (error.format_message(),)
        case typer.TyperException():
            command = getattr(getattr(error, "ctx", None), "command_path", "coramp")
            text = error.format_message().rstrip(".")
            code, messages = USAGE, (f"{text}; see {command} --help",)
        case typer.Abort():
            code, messages = STOPPED, ("stopped",)
        case OSError() if error.filename:
            code, messages = WRONG, (f"{error.filename}: {error.strerror}",)
        case _:
            text = f"unexpected {type(error).__name__}: {error}; add {DEBUG} to see where"
            code, messages = WRONG, (text,)
    for message in messages:
        print(f"Error: {printable(str(message))}", file=sys.stderr)
    return code
