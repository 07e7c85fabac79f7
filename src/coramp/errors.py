"""Errors that coramp reports in one line each."""


def printable(text: str) -> str:
    """Returns a text of somebody else in one line, with what would control a terminal escaped."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


class CorampError(Exception):
    """Something that its user can mend; ``messages`` are its lines, without ``Error:``."""

    def __init__(self, *messages: str) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages
