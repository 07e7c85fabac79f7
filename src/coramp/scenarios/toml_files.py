"""Reading TOML files: built-in or the user's, with overrides, into models, with clear errors."""

import difflib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from coramp.errors import CorampError
from coramp.scenarios.plain_data import (
    DEEPEST,
    TOO_DEEP,
    TOO_LARGE,
    TOO_LONG_KEY,
    long_key_in,
    problem_with,
    shortened,
)

AnyModel = TypeVar("AnyModel", bound=BaseModel)
Data = dict[str, Any]
KINDS = ("scenarios", "snapshots", "studies")
SHAPES = ("(one)", "(list)")
"""Tags of a value that may be one or a list; they are no part of its key."""


def builtin_names(kind: str) -> list[str]:
    """Returns the names of the built-in files of one of the ``KINDS``."""
    folder = resources.files("coramp") / "data" / kind
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def builtin_text(name: str) -> str:
    """Returns a built-in file as it is: the scenario of that name, or else snapshot, or study.

    ``studies/paper`` asks for a kind. Raises CorampError where there is none.
    """
    asked, _, plain = name.rpartition("/")
    for kind in (asked,) if asked in KINDS else KINDS:
        if plain in builtin_names(kind):
            return _builtin(kind, plain)
    known = ", ".join(f"{kind}/{known}" for kind in KINDS for known in builtin_names(kind))
    raise CorampError(f"{name}: nothing built in is called that; built in are {known}")


def _builtin(kind: str, name: str) -> str:
    return (resources.files("coramp") / "data" / kind / f"{name}.toml").read_text(encoding="utf-8")


def read(kind: str, name: str) -> tuple[str, Data]:
    """Returns a label for errors and the content of a built-in or a file.

    Raises CorampError where there is neither, or where the file is no TOML or empty.
    """
    if name in builtin_names(kind):
        label = name
        text = _builtin(kind, name)
    else:
        label, text = name, _text_of(Path(name), kind)
    data = _parsed(text, label)
    if not data:
        raise CorampError(
            f"{label}: the file is empty; allowed is TOML that describes {_what(kind)}"
        )
    return label, data


def _parsed(text: str, label: str) -> Data:
    """Returns the content of a TOML text; errors begin with the label."""
    if (key := long_key_in(text)) is not None:
        raise CorampError(f"{label}: {key}: {TOO_LONG_KEY}")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CorampError(f"{label}: {error}; allowed is TOML") from error
    except RecursionError:
        raise CorampError(f"{label}: {TOO_DEEP}") from None
    except ValueError:  # Python converts no number of more than 4300 digits
        raise CorampError(f"{label}: a number {TOO_LARGE}") from None
    if (problem := problem_with(data)) is not None:
        raise CorampError(f"{label}: {problem}")
    return data


def _text_of(path: Path, kind: str) -> str:
    known = ", ".join(builtin_names(kind))
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        near = difflib.get_close_matches(str(path), builtin_names(kind), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise CorampError(f"{path}: no such file or built-in{hint}; built in are {known}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise CorampError(f"{path}: cannot be read: {reason}; allowed is a TOML file") from None


def _what(kind: str) -> str:
    return {"scenarios": "a scenario", "studies": "a study", "snapshots": "a snapshot"}[kind]


def parse_overrides(texts: Sequence[str]) -> dict[str, Any]:
    """Returns dotted keys and values of ``KEY=VALUE`` texts; a value is TOML, or else a string."""
    overrides: dict[str, Any] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key.strip():
            raise CorampError(f"--set: {text}: is not KEY=VALUE; an example is control.step_s=0.05")
        if key.strip() in overrides:
            raise CorampError(f"--set: {key.strip()}: given twice; allowed is once")
        if "\n" in text:
            raise CorampError(f"--set: {text}: has a line break; allowed is one KEY=VALUE")
        overrides[key.strip()] = _value_of(key.strip(), value)
    return overrides


def override_text(key: str, value: Any) -> str:
    """Returns the text ``KEY=VALUE`` that ``parse_overrides`` makes these of."""
    if isinstance(value, str) and value == value.strip() and _value_of(key, value) == value:
        return f"{key}={value}"  # a word that needs no quotes
    return f"{key}={_toml(value)}"


def _toml(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case list() | tuple():
            return f"[{', '.join(map(_toml, value))}]"
        case dict():
            inner = (f"{json.dumps(str(name))} = {_toml(v)}" for name, v in value.items())
            return f"{{{', '.join(inner)}}}"
        case str():
            return json.dumps(value, ensure_ascii=False)
        case _:
            return repr(value)


def _value_of(key: str, text: str) -> Any:
    blamed = f"--set: {shortened(key)}"
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()
    except RecursionError:
        raise CorampError(f"{blamed}: {TOO_DEEP}") from None
    except ValueError:
        raise CorampError(f"{blamed}: {TOO_LARGE}") from None


def with_overrides(data: Data, overrides: Mapping[str, Any], origins: Mapping[str, str]) -> Data:
    """Returns a copy of the data with dotted keys set; ``origins`` says who set each."""
    result = _copied(data)
    for dotted, value in overrides.items():
        _check_override(dotted, value, origins.get(dotted, ""))
        *parents, last = key_parts(data, dotted)
        table = result
        for parent in parents:
            table = table.setdefault(parent, {})
            if not isinstance(table, dict):
                line = f"{dotted}: {parent} is not a table; see coramp scenarios"
                raise CorampError(_blamed(line, origins[dotted]))
        table[last] = value
    return result


def _check_override(dotted: str, value: Any, origin: str) -> None:
    if dotted.count(".") >= DEEPEST:
        raise CorampError(_blamed(f"{shortened(dotted)}: {TOO_LONG_KEY}", origin))
    if (problem := problem_with(value, dotted)) is not None:
        raise CorampError(_blamed(problem, origin))


def key_parts(data: Any, dotted: str) -> list[str]:
    """Returns the parts of a dotted key; names that are there may hold dots of their own."""
    if isinstance(data, dict):
        known = [name for name in data if dotted == name or dotted.startswith(f"{name}.")]
        if known:
            name = max(known, key=len)
            rest = dotted.removeprefix(name).removeprefix(".")
            return [name, *(key_parts(data[name], rest) if rest else ())]
    first, _, rest = dotted.partition(".")
    return [first, *(key_parts(None, rest) if rest else ())]


def _copied(data: Data) -> Data:
    return {k: _copied(v) if isinstance(v, dict) else v for k, v in data.items()}


def validated(
    model: type[AnyModel], data: Data, label: str, overridden: Mapping[str, str] | None = None
) -> AnyModel:
    """Returns the model of the data.

    Raises CorampError with one message for each problem: where, which key, what is wrong, what is
    allowed. ``overridden`` names where overridden keys came from, to be told instead of the label;
    an empty name leaves it to the caller to tell.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        lines = [line for problem in _causes(error) for line in _lines_of(model, problem)]
    messages = []
    for line in dict.fromkeys(lines):
        key = line.split(":", 1)[0]
        origins = [
            origin
            for name, origin in (overridden or {}).items()
            if key == name or key.startswith(f"{name}.") or name.startswith(f"{key}.")
        ]
        messages.append(_blamed(line, origins[0] if origins else label))
    raise CorampError(*messages)


def _blamed(line: str, origin: str) -> str:
    return f"{origin}: {line}" if origin else line


def _causes(error: ValidationError) -> list[Any]:
    """The problems without those that only follow: a list whose items fail counts as too short."""
    problems = error.errors()
    places = [problem["loc"] for problem in problems]
    return [
        problem
        for problem in problems
        if problem["type"] != "too_short"
        or not any(p[: len(problem["loc"])] == problem["loc"] != p for p in places)
    ]


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
            return [f"{key}: is missing; it must be given"]
        case "finite_number":
            return [f"{key}: {shown} is not finite; allowed is a finite number"]
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return [f"{key}: {shown} is {_out_of_range(key, float(value), context)}"]
        case "float_type" | "int_type":
            return [f"{key}: {shown} is not a number; allowed is a number"]
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


def _allowed_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> str:
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
    names = sorted(model.model_fields)
    near = difflib.get_close_matches(str(location[-1]), names, 1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"{hint}allowed are {', '.join(names)}"


def _shape_of(annotation: Any, tag: str) -> Any:
    """Returns the one of several shapes of a value that has a tag of ``SHAPES``."""
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
