"""How these tests call the command line and write the files that it reads."""

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from coramp.cli.entry import main


@dataclass(frozen=True)
class Told:
    """What one call of the command line printed, and its exit code."""

    code: int
    out: str
    err: str

    @property
    def errors(self):
        return self.err.splitlines()


def invoke(*arguments):
    """Calls the command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
    return Told(code, out.getvalue(), err.getvalue())


def built_in(kind, name):
    return (resources.files("coramp") / "data" / kind / f"{name}.toml").read_text("utf-8")


def edited(text, changes: Mapping[str, str]):
    """Returns the text with every change made once; a change of what is not there is a mistake."""
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def everything_below(folder):
    """Returns all paths below a folder, hidden ones too."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def assert_refused(told, code=1):
    """Asserts that errors are all that was printed, one a line, and that none is a traceback."""
    assert told.code == code
    assert told.out == ""
    assert told.errors
    for line in told.errors:
        assert line.startswith("Error: ")
        assert "Traceback" not in line
        assert not line.startswith("Error: unexpected")


SMALL_STUDY = """
name = "small"
scenario = "paper"
seeds = 1
horizon_s = 20.0

[[runs]]
strategies = ["mainline-priority"]
mainline_veh_h = [800.0]
ramp_veh_h = [500.0]
"""
