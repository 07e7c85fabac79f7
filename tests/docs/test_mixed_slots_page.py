"""The page of mixed slots has the numbers of the laws."""

from pathlib import Path

from coramp.mixed.laws import FollowingLaw, SafetyLaw, SequenceLaw
from coramp.worlds.sumo import mixed_setup

PAGE = Path(__file__).parents[2] / "docs" / "strategies" / "mixed-slots.md"


def test_the_numbers_of_the_page_are_those_of_the_laws():
    text = PAGE.read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in text.split("## Numbers")[1].splitlines()]
    found = {row[0].strip(" `"): row[1].strip() for row in rows if len(row) == 2}
    laws = (FollowingLaw(), SequenceLaw(), SafetyLaw())
    numbers = {name: f"{value:g}" for law in laws for name, value in law._asdict().items()}
    assert {name: found.get(name) for name in numbers} == numbers
    assert (
        f"{mixed_setup.MORE_BEHIND_DRIVER_M:g} m and\n{mixed_setup.MORE_BEHIND_DRIVER_S:g} s more"
        in text
    )
    assert f"that gap and {mixed_setup.MORE_FOR_DRIVER_S:g} s more" in text
