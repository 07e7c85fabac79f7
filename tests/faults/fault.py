"""What a fault is: the code that is changed, and what is to show it."""

from typing import NamedTuple


class Edit(NamedTuple):
    """One piece of code that is changed: the file below ``src/coramp``, and its text."""

    path: str
    before: str
    after: str


class Fault(NamedTuple):
    """A fault: its name, its edits, and the run (options of ``coramp run``) that is to show it.

    ``test`` is for a fault that hardly any run shows: it is that of a worked number. Without a run
    the test is all there is.
    """

    name: str
    edits: tuple[Edit, ...]
    run: tuple[str, ...]
    test: str = ""
