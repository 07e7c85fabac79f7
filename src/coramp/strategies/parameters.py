"""What a strategy can be told: its dataclass fields, each with a range or choices."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from typing import Any, cast

Value = float | int | str | bool


def parameter(
    default: Value, low: float = -math.inf, high: float = math.inf, *, meaning: str
) -> Any:
    """Returns a dataclass field that a scenario may set between ``low`` and ``high``.

    The field's name ends in its unit; ``meaning`` says what it does. For use in the body of a
    frozen dataclass that is a strategy.
    """
    return field(default=default, metadata={"low": low, "high": high, "meaning": meaning})


def choice(default: str, *choices: str, meaning: str) -> Any:
    """Returns a dataclass field that a scenario may set to one of ``choices``."""
    return field(default=default, metadata={"choices": (default, *choices), "meaning": meaning})


@dataclass(frozen=True, slots=True)
class Parameter:
    """One thing that a strategy can be told: name, default, what is allowed, what it does."""

    name: str
    default: Value
    allowed: str
    meaning: str


def parameters_of(strategy: type) -> list[Parameter]:
    """Returns what a strategy can be told, in the order of its fields."""
    return [
        Parameter(f.name, cast("Value", f.default), _allowed(f), str(f.metadata.get("meaning", "")))
        for f in _settable(strategy)
    ]


def wrong_settings(strategy: type, settings: Mapping[str, Any]) -> list[str]:
    """Returns a line ``key: what is wrong; what is allowed`` for each setting that cannot be."""
    known = {f.name: f for f in _settable(strategy)}
    return [line for key, value in settings.items() if (line := _wrong(known, key, value))]


def wrong_together(strategy: type, settings: Mapping[str, Any]) -> list[str]:
    """Returns a line for each setting that does not fit the others, as the strategy tells.

    What a strategy raises here is told when it is to run.
    """
    if not hasattr(strategy, "problems"):
        return []
    try:
        return [str(line) for line in strategy(**settings).problems()]
    except Exception:  # noqa: BLE001 - it may raise anything
        return []


def _settable(strategy: type) -> list[Field[Any]]:
    if not is_dataclass(strategy):
        return []
    return [f for f in fields(strategy) if f.init and f.default is not MISSING]


def _wrong(known: Mapping[str, Field[Any]], key: str, value: Any) -> str:
    if key not in known:
        names = ", ".join(known) or "none: the strategy has no parameters"
        return f"{key}: there is no such parameter; allowed are {names}"
    asked = known[key]
    return (
        "" if _fits(asked, value) else f"{key}: {value!r} cannot be; allowed is {_allowed(asked)}"
    )


def _fits(asked: Field[Any], value: Any) -> bool:
    if "choices" in asked.metadata:
        return value in asked.metadata["choices"]
    if isinstance(asked.default, bool) or isinstance(value, bool):
        return isinstance(value, bool) and isinstance(asked.default, bool)
    if isinstance(asked.default, int) and not isinstance(value, int):
        return False
    if isinstance(asked.default, str):
        return isinstance(value, str)
    return isinstance(value, int | float) and _low(asked) <= value <= _high(asked)


def _low(asked: Field[Any]) -> float:
    return float(asked.metadata.get("low", -math.inf))


def _high(asked: Field[Any]) -> float:
    return float(asked.metadata.get("high", math.inf))


def _allowed(asked: Field[Any]) -> str:
    if "choices" in asked.metadata:
        return " or ".join(asked.metadata["choices"])
    if isinstance(asked.default, bool):
        return "true or false"
    if isinstance(asked.default, str):
        return "a text"
    kind = "a whole number" if isinstance(asked.default, int) else "a number"
    low, high = _low(asked), _high(asked)
    if math.isinf(low) and math.isinf(high):
        return kind
    return f"{kind} from {low:g} to {high:g}" if math.isfinite(high) else f"{kind} from {low:g} up"
