"""Limits on data from files and settings, so that everything behind them may trust it.

Whatever passes can be walked recursively, printed, and turned into floats.
"""

import re
from typing import Any

DEEPEST = 32
"""So many tables and lists may lie in each other, and so many parts may a dotted key have."""
LARGEST_INTEGER = 2**63 - 1
"""TOML's integers have 64 bits."""
SHOWN = 60
"""Characters of a key or value that an error repeats."""
_PART = r"""(?:(?<![\w-])[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST},}}")
TOO_DEEP = f"is nested too deep; allowed are {DEEPEST} tables and lists in each other"
TOO_LONG_KEY = f"has too many parts; allowed are {DEEPEST}"
TOO_LARGE = f"is too large; allowed are whole numbers up to {LARGEST_INTEGER}"


def long_key_in(text: str) -> str | None:
    """Returns the first dotted key of a TOML text that has too many parts, shortened, or None.

    To be asked before the text is parsed: that takes the square of the number of parts.
    """
    found = _LONG_KEY.search(text)
    return shortened(found.group()) if found else None


def problem_with(data: Any, key: str = "") -> str | None:
    """Returns ``key: what is wrong; what is allowed`` for plain data within no limits, or None."""
    left = [(key, data, 0)]
    while left:
        place, value, depth = left.pop()
        if isinstance(value, dict):
            inner = [(f"{place}.{name}" if place else str(name), v) for name, v in value.items()]
        elif isinstance(value, list | tuple):
            inner = [(place, v) for v in value]
        else:
            if isinstance(value, int) and not -LARGEST_INTEGER <= value <= LARGEST_INTEGER:
                return f"{shortened(place)}: {TOO_LARGE}"
            continue
        if depth == DEEPEST:
            return f"{shortened(place)}: {TOO_DEEP}"
        left.extend((name, v, depth + 1) for name, v in reversed(inner))
    return None


def shortened(text: str) -> str:
    """Returns a text that fits into an error."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
