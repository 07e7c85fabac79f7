"""How a vehicle comes onto the mainline: three states, and one place that tells them apart."""

import re
from pathlib import Path

import pytest

import coramp
from coramp.checker import merging
from coramp.vehicles.merge_state import (
    BY_MAINLINE_S,
    NOT_PLANNED_S,
    came_by_mainline,
    has_place_on_mainline,
    is_on_mainline,
    is_planned,
    is_waiting,
    is_yet_to_merge,
    merge_time_at_entry_s,
)

TIMES = (BY_MAINLINE_S, 0.0, 12.5, NOT_PLANNED_S)
PLACES = {"vehicles/merge_state.py", "checker/merging.py"}
COMPARED = re.compile(
    r"merge\w*(\([^()]*\)|\[[^\]]*\])?\)? *(<=?|>=?|==|!=) *-?(math|np)\.inf\b"
    r"|-?(math|np)\.inf\b *(<=?|>=?|==|!=) *\w*merge"
    r"|is(inf|finite)\([^()]*merge"
)


@pytest.mark.parametrize("merge_s", TIMES)
def test_a_vehicle_is_in_one_state(merge_s):
    assert came_by_mainline(merge_s) + is_planned(merge_s) + is_waiting(merge_s) == 1
    assert has_place_on_mainline(merge_s) == (not is_waiting(merge_s))


def test_who_enters_comes_by_the_mainline_or_waits():
    assert came_by_mainline(merge_time_at_entry_s(False))
    assert is_waiting(merge_time_at_entry_s(True))


def test_a_planned_merge_counts_from_its_time_on():
    assert [is_on_mainline(12.5, time_s) for time_s in (12.4, 12.5, 12.6)] == [False, True, True]
    assert [is_yet_to_merge(12.5, time_s) for time_s in (12.4, 12.5, 12.6)] == [True, False, False]


def test_without_a_planned_merge_the_time_does_not_matter():
    assert is_on_mainline(BY_MAINLINE_S, 0.0)
    assert not is_yet_to_merge(BY_MAINLINE_S, 0.0)
    assert not is_on_mainline(NOT_PLANNED_S, 1e9)
    assert not is_yet_to_merge(NOT_PLANNED_S, 0.0)


@pytest.mark.parametrize("on_ramp", [False, True])
def test_the_checker_has_words_of_its_own_for_the_same(on_ramp):
    merge_s = merging.merge_at_entry_s(on_ramp)
    assert merge_s == merge_time_at_entry_s(on_ramp)
    assert merging.comes_onto_mainline(merge_s) == has_place_on_mainline(merge_s)
    assert merging.comes_onto_mainline(12.5)


@pytest.mark.parametrize(
    "line",
    [
        "if fleet.merge_time_s[row] == math.inf:",
        "if ledger.merge_time_s(row) < math.inf:",
        "if math.isinf(merge_s) and other:",
        "if t < merge_s < math.inf:",
        "return -np.inf < merge_s",
    ],
)
def test_comparisons_with_infinity_are_found(line):
    assert COMPARED.search(line)


def test_no_other_module_compares_merge_times_with_infinities():
    package = Path(coramp.__file__).parent
    found = [
        f"{path.relative_to(package)}: {line.strip()}"
        for path in sorted(package.rglob("*.py"))
        if path.relative_to(package).as_posix() not in PLACES
        for line in path.read_text().splitlines()
        if COMPARED.search(line)
    ]
    assert found == []
