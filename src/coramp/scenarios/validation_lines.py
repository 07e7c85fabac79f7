"""What a model refuses, in lines: which key, what is wrong, what is allowed."""

import copy
import difflib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from coramp.road.streams import STREAMS
from coramp.scenarios.speeds_kmh import KEYS, LIST, in_mps

Location = tuple[int | str, ...]
OTHER_KIND = {
    "float_type": "not a number; allowed is a number",
    "int_type": "not a number; allowed is a number",
    "finite_number": "not finite; allowed is a finite number",
    "string_type": "not a text; allowed is one text in quotes",
}
"""What a value of another kind than a key's is."""
PATTERNS = {
    r"^[^\s<>&\"',;]+$": "a name without spaces and without < > & \" ' , ;",
    r"^[A-Za-z0-9_-]+$": "a name of letters, digits, _ and -",
    "^[0-9a-f]{64}$": "a hash of 64 hexadecimal digits",
}
"""What texts of a pattern are."""
SHAPES = ("(one)", "(list)")
"""Tags of a value that may be one or a list; they are no part of its key."""


def lines_of(model: type[BaseModel], data: Mapping[str, Any], error: ValidationError) -> list[str]:
    """Returns a line ``key: what is wrong; what is allowed`` for each problem with the data.

    What must fit together is checked once every key by itself is right; unknown keys do not keep it
    from being told.
    """
    causes = _causes(model, error)
    lines = _told(model, error)
    if all(problem["type"] == "extra_forbidden" for problem in causes):
        lines += _problems_without(model, data, [problem["loc"] for problem in causes])
    return lines


def _told(model: type[BaseModel], error: ValidationError) -> list[str]:
    return [line for problem in _causes(model, error) for line in _lines_of(model, problem)]


def _problems_without(
    model: type[BaseModel], data: Mapping[str, Any], unknown: Sequence[Location]
) -> list[str]:
    """What else is wrong, whatever the unknown keys were meant to be.

    That is told of the data both without them and with those that they resemble in their place:
    what only a misspelt key makes wrong is no error of its own.
    """
    left_out, meant = copy.deepcopy(dict(data)), copy.deepcopy(dict(data))
    for location in unknown:
        _table_of(left_out, location).pop(location[-1])
        table = _table_of(meant, location)
        value = table.pop(location[-1])
        if near := _near_keys(model, location):
            in_kmh = near[0] in KEYS
            table.setdefault(KEYS.get(near[0], near[0]), in_mps(value) if in_kmh else value)
    lines, others = _together(model, left_out), _together(model, meant)
    return [line for line in lines or () if others is None or line in others]


def _table_of(data: Mapping[str, Any], location: Location) -> Any:
    table: Any = data
    for part in location[:-1]:
        if part not in SHAPES:
            table = table[part]
    return table


def _together(model: type[BaseModel], data: Mapping[str, Any]) -> list[str] | None:
    """What does not fit together in data; None where keys are wrong by themselves."""
    try:
        model.model_validate(data)
    except ValidationError as error:
        together = all(problem["type"] == "value_error" for problem in error.errors())
        return _told(model, error) if together else None
    return []


def _causes(model: type[BaseModel], error: ValidationError) -> list[Any]:
    """The problems without those that only follow from others.

    A list whose items fail counts as too short, a misspelt key as missing, and so does what is
    chosen by a stream's speed where that is missing.
    """
    problems = error.errors()
    places = [problem["loc"] for problem in problems]
    misspelt = {
        (*place[:-1], KEYS.get(near, near))
        for problem in problems
        if problem["type"] == "extra_forbidden"
        for place in [problem["loc"]]
        for near in _near_keys(model, place)
    }
    missing = {problem["loc"] for problem in problems if problem["type"] == "missing"}
    return [
        problem
        for problem in problems
        if not (
            (problem["type"] == "too_short" and _fails_within(problem["loc"], places))
            or (problem["type"] == "missing" and problem["loc"] in misspelt)
            or (problem["type"] == "missing" and _follows_from(problem["loc"]) in missing)
        )
    ]


def _fails_within(place: Location, places: Sequence[Location]) -> bool:
    return any(other[: len(place)] == place != other for other in places)


def _follows_from(place: Location) -> Location | None:
    """The key that a missing one is chosen by where it is left out: a stream's speed."""
    follows = place[-1] in ("limit_mps", "entry_speed_mps")
    return (*place[:-1], "speed_mps") if follows else None


def _lines_of(model: type[BaseModel], problem: Any) -> list[str]:
    if problem["type"] == "value_error":
        return str(problem["ctx"]["error"]).splitlines()
    key = ".".join(str(part) for part in problem["loc"] if part not in SHAPES)
    value, context = problem["input"], problem.get("ctx", {})
    shown = f"{value:g}" if isinstance(value, float) else repr(value)
    match problem["type"]:
        case "extra_forbidden":
            return [f"{key}: unknown key; {_allowed_keys(model, problem['loc'])}"]
        case "missing":
            return [f"{key}: is missing; {_how_to_give(problem['loc'])}"]
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return [f"{key}: {shown} is {_out_of_range(key, float(value), context)}"]
        case kind if kind in OTHER_KIND:
            return [f"{key}: {shown} is {OTHER_KIND[kind]}"]
        case "string_pattern_mismatch" if context["pattern"] in PATTERNS:
            return [f"{key}: {shown} cannot be; allowed is {PATTERNS[context['pattern']]}"]
        case "literal_error":
            return [f"{key}: {shown} is not known; allowed is {context['expected']}"]
        case "model_type" | "dict_type" | "model_attributes_type":
            return [f"{key}: {shown} is not a table; allowed is a TOML table"]
        case (
            "tuple_type"
            | "list_type"
            | "too_short"
            | "too_long"
            | "missing_positional_only_argument"
        ):
            field = model.model_fields.get(str(problem["loc"][0]))
            tables = field is not None and _model_within(field.annotation) is not None
            example = "of tables" if tables and len(problem["loc"]) == 1 else "like [15.0, 20.0]"
            return [f"{key}: {shown} has the wrong shape; allowed is a list {example}"]
        case _:
            message = problem["msg"]
            return [f"{key}: {shown}: {message[0].lower()}{message[1:]}"]


def _how_to_give(place: Location) -> str:
    """How to give a key that is missing; a stream's limit alone does not say its speed."""
    if len(place) != 2 or place[0] not in STREAMS or place[1] != "speed_mps":
        return "it must be given"
    return (
        f"give {place[0]}.speed_kmh or {place[0]}.speed_mps, the speed at which vehicles drive; "
        "the limit follows from it"
    )


def _out_of_range(key: str, value: float, context: Mapping[str, float]) -> str:
    bounds = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    (name, bound), *_ = ((n, b) for n, b in context.items() if n in bounds)
    side = "too small" if name in ("gt", "ge") else "too large"
    text = f"{side}; allowed is {bounds[name]} {bound:g}"
    if "speed_mps" in key or "limit_mps" in key:
        text += " m/s"
        if name == "le" and math.isfinite(value):
            text += f" (if {value:g} is meant in km/h, write {value / 3.6:.4g})"
    return text


def _allowed_keys(model: type[BaseModel], location: Location) -> str:
    near = _near_keys(model, location)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"{hint}allowed are {', '.join(_keys_at(model, location))}"


def _near_keys(model: type[BaseModel], location: Location) -> list[str]:
    """The key that an unknown one resembles most, if there is one."""
    return difflib.get_close_matches(str(location[-1]), _keys_at(model, location), 1)


def _keys_at(model: type[BaseModel], location: Location) -> list[str]:
    """The keys that a table may have in which a key lies."""
    inner: Any = None
    for part in location[:-1]:
        if part in SHAPES:
            model = _model_within(_shape_of(inner, str(part))) or model
            continue
        field = model.model_fields.get(str(part))
        inner = field.annotation if field is not None else None
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            model = inner
        elif not isinstance(part, int):
            model = _model_within(inner) or model
    scenario = location[0] in (*STREAMS, LIST)
    in_kmh = [kmh for kmh, mps in KEYS.items() if scenario and mps in model.model_fields]
    return sorted([*model.model_fields, *in_kmh])


def _shape_of(annotation: Any, tag: str) -> Any:
    """The one of several shapes of a value that has a tag of ``SHAPES``."""
    for shape in getattr(annotation, "__args__", ()):
        if any(getattr(mark, "tag", None) == tag for mark in getattr(shape, "__metadata__", ())):
            return shape
    return None


def _model_within(annotation: Any) -> type[BaseModel] | None:
    for argument in getattr(annotation, "__args__", ()):
        if isinstance(argument, type) and issubclass(argument, BaseModel):
            return argument
        inner = _model_within(argument)
        if inner is not None:
            return inner
    return None
