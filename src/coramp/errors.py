"""Errors that coramp reports in one line each."""


class CorampError(Exception):
    """Something that its user can mend; ``messages`` are its lines, without ``Error:``."""

    def __init__(self, *messages: str) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages
