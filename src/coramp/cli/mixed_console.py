"""A story of mixed traffic, on a terminal and as plain data."""

import dataclasses

from coramp.explain.mixed_story import MixedChapter, MixedStory
from coramp.records.schemas import Row
from coramp.studies.tables import number


def print_mixed_story(story: MixedStory) -> None:
    """Prints what a vehicle did, what was known when it did so, and what was assumed."""
    vehicle = story.vehicle
    kind = "automated" if vehicle["automated"] else "driver"
    named = f"{vehicle['vehicle_id']} ({vehicle['stream']}, {kind})"
    print(f"{named}, {story.run['scenario']}, {story.run['strategy']}")
    print("Assumed:")
    for line in story.assumed:
        print(f"  {line}")
    print("What it did:")
    print(f"  {number(vehicle['scheduled_s'], 1)} s: due at the zone's start")
    for chapter in story.chapters:
        print(f"  {_when(chapter)}: {chapter.text}")
        for line in (*chapter.gaps, *chapter.known):
            print(f"      {line}")
    if vehicle["exit_s"] is not None:
        print(f"  {number(vehicle['exit_s'], 1)} s: leaves; delay {number(vehicle['delay_s'])} s")
    else:
        print("  not out when the run was cut off")


def _when(chapter: MixedChapter) -> str:
    from_s, until_s = (f"{time_s:.1f}" for time_s in (chapter.from_s, chapter.until_s))
    return f"{from_s} s" if from_s == until_s else f"{from_s} to {until_s} s"


def mixed_story_json(story: MixedStory) -> Row:
    """Returns a story of mixed traffic as plain data."""
    return {"kind": "story", **dataclasses.asdict(story)}
