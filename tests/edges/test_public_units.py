"""Names of public quantities end in their unit; docstrings name the paper's equations."""

import dataclasses
import importlib
import inspect
import re
import typing

import pytest

from tests.mathematics import mathematics

MODULES = [
    *(module.__name__ for module in mathematics().values()),
    "coramp.strategies.base",
    "coramp.messages.commands",
    "coramp.messages.events",
]
UNITS = re.compile(r"_(m|s|mps|mps2|mps3|m2ps4|mlps|l|kg|wpkg|rad|deg|veh_h)$")
DIMENSIONLESS = {
    "adhesion",
    "resistance",
    "mass_ratio",
    "log10_mass_ratio",
    "speed_deviation",
    "slow_deviation",
    "slowest_share",
    "mainline_occupancy",
    "queue_occupancy",
}
GENERIC = {"constant", "slope", "curvature", "duration"}
"""Of ``smallest_of_quadratic``, which knows no units."""
IN_M2PS4 = {f"{form}severity_{when}" for form in ("", "relative_") for when in ("before", "after")}
"""Severities, named like the columns of ``decisions.parquet``."""
RETURNS_A_TIME = {"time_to_cover", "time_at_station"}


def _members(name):
    """Public functions (as plain Python) and classes that a module defines."""
    module = importlib.import_module(name)
    for member_name, member in vars(module).items():
        plain = getattr(member, "py_func", member)
        if member_name.startswith("_") or getattr(plain, "__module__", None) != name:
            continue
        if inspect.isfunction(plain) or inspect.isclass(plain):
            yield member_name, plain


MATHEMATICS = {module.__name__ for module in mathematics().values()}
FUNCTIONS = [
    (f"{module}.{name}", member)
    for module in MODULES
    for name, member in _members(module)
    if inspect.isfunction(member)
]
CLASSES = [
    (f"{module}.{name}", member)
    for module in MODULES
    for name, member in _members(module)
    if inspect.isclass(member)
]


def _methods(cls):
    return [
        method
        for name, method in vars(cls).items()
        if inspect.isfunction(method) and not name.startswith("_")
    ]


def _is_float(annotation):
    return annotation is float or (
        typing.get_origin(annotation) is not tuple and float in typing.get_args(annotation)
    )


def _without_unit(hints):
    return [
        name
        for name, annotation in hints.items()
        if name != "return" and _is_float(annotation) and not UNITS.search(name)
    ]


def test_the_walk_finds_what_there_is():
    names = [name for name, _ in FUNCTIONS + CLASSES]
    assert len(FUNCTIONS) > 90
    assert "coramp.equations.safe_distance.safe_distance_m" in names
    assert "coramp.road.rules.SafetyBudget" in names
    assert "coramp.strategies.base.View" in names
    assert "coramp.messages.events.RequestToEnter" in names
    hints = typing.get_type_hints(dict(FUNCTIONS)["coramp.kinematics.trajectory.time_to_cover"])
    assert _without_unit({**hints, "speed": float}) == ["speed"]


@pytest.mark.parametrize(("name", "function"), FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_float_parameters_end_in_their_unit(name, function):
    allowed = DIMENSIONLESS | (GENERIC if name.endswith(".smallest_of_quadratic") else set())
    assert set(_without_unit(typing.get_type_hints(function))) <= allowed


@pytest.mark.parametrize(("name", "cls"), CLASSES, ids=[name for name, _ in CLASSES])
def test_float_fields_and_parameters_of_methods_end_in_their_unit(name, cls):
    missing = set(_without_unit(typing.get_type_hints(cls)))
    for method in _methods(cls):
        missing |= set(_without_unit(typing.get_type_hints(method)))
    assert missing <= (IN_M2PS4 if name.endswith(".Explanation") else DIMENSIONLESS)


def test_functions_that_return_a_quantity_end_in_its_unit():
    missing = {
        name.rsplit(".", 1)[1]
        for name, function in FUNCTIONS
        if typing.get_type_hints(function).get("return") is float and not UNITS.search(name)
    }
    assert missing == RETURNS_A_TIME


def test_every_exception_is_one():
    used = set()
    for _, function in FUNCTIONS:
        used |= set(_without_unit(typing.get_type_hints(function)))
    for _, cls in CLASSES:
        used |= set(_without_unit(typing.get_type_hints(cls)))
    assert used == DIMENSIONLESS | GENERIC | IN_M2PS4


@pytest.mark.parametrize(
    ("name", "member"), FUNCTIONS + CLASSES, ids=[name for name, _ in FUNCTIONS + CLASSES]
)
def test_public_members_say_what_they_are(name, member):
    own = member.__dict__.get("__doc__") if inspect.isclass(member) else member.__doc__
    assert own
    # a dataclass or NamedTuple without a docstring gets its signature for one
    assert not own.startswith(f"{member.__name__}(")
    if dataclasses.is_dataclass(member) or hasattr(member, "_fields"):
        assert own.rstrip().endswith(".")


def _equations(docstring):
    """Numbers named as in "Eq. 12", "Eq. 25, 26", "Eq. 22; 32", "Eq. 1, 15 and 16"; no ranges."""
    joined = " ".join(docstring.split())
    found = set()
    for match in re.finditer(r"Eq\. (\d+(?:(?:, | and | or |; )\d+)*)(-\d)?", joined):
        numbers = [int(number) for number in re.findall(r"\d+", match[1])]
        found |= set(numbers[:-1] if match[2] else numbers)
    return found


def test_lists_of_equations_are_read_and_ranges_are_not():
    assert _equations("as (Eq. 25, 26), Eq. 1, 15\n    and 16; Eq. 22; 32 for a_r'") == {
        *(25, 26, 1, 15, 16, 22, 32)
    }
    assert _equations("Eq. 10-14, and Eq. 5, 7-9 in 48 m") == {5}


def test_every_equation_of_the_paper_is_named_where_it_is_computed():
    named = {number: [] for number in range(1, 49)}
    improvement = importlib.import_module("coramp.studies.statistics")
    functions = [
        *((name, f) for name, f in FUNCTIONS if name.rsplit(".", 1)[0] in MATHEMATICS),
        *((name, f) for name, f in vars(improvement).items() if inspect.isfunction(f)),
    ]
    for name, function in functions:
        for number in _equations(function.__doc__ or "") & named.keys():
            named[number].append(name)
    assert [number for number, where in named.items() if not where] == []
