"""What ``coramp new-scenario`` was asked for, as the content of a scenario."""

from pathlib import Path
from typing import Any, NamedTuple

from coramp.errors import CorampError
from coramp.scenarios.counted import (
    CountsChoice,
    classes_of,
    road_of,
    stations_of,
    with_counts_tables,
)
from coramp.scenarios.new_scenario import new_scenario_data, osm_network_beside

ROAD = "paper"
"""The scenario whose road one with counts has where nothing is said."""


class Asked(NamedTuple):
    """The options of the command; None where one is left out."""

    ramp: str | None
    net: Path | None
    osm: Path | None
    road: str | None
    counts: Path | None
    mainline_detector: str | None
    ramp_detector: str | None
    detector: list[str]
    classes: list[str]
    repair: bool


def content_of(asked: Asked, target: Path) -> tuple[dict[str, Any], list[str]]:
    """Returns the content of the scenario for a file, and a line for each repair of its counts.

    Raises CorampError for options that do not go together, and for what they name and is not there.
    """
    choice = _choice(asked)
    data = _road(asked, target)
    if choice is None:
        return data, []
    data, repairs = with_counts_tables(data, choice, target.parent)
    return data, [repair.line(str(choice.file)) for repair in repairs]


def _road(asked: Asked, target: Path) -> dict[str, Any]:
    networks = [file for file in (asked.net, asked.osm) if file is not None]
    if len(networks) > 1:
        raise CorampError("--net, --osm: allowed is one of them: a network, or what to make it of")
    if not networks:
        if asked.counts is None:
            raise CorampError("--net, --osm, --counts: none is given; allowed is one at least")
        if asked.ramp is not None:
            raise CorampError("--ramp: is an on-ramp of a network; allowed with --net or --osm")
        return road_of(asked.road or ROAD)
    if asked.road is not None:
        raise CorampError("--road: beside a network; allowed is one of them")
    if asked.ramp is None:
        raise CorampError("--ramp: is missing; give an id that coramp ramps lists")
    net = asked.net or osm_network_beside(networks[0], target)
    return new_scenario_data(net, asked.ramp, target.parent)


def _choice(asked: Asked) -> CountsChoice | None:
    of_counts = {
        "--mainline-detector": asked.mainline_detector,
        "--ramp-detector": asked.ramp_detector,
    }
    if asked.counts is None:
        others = {"--detector": asked.detector, "--class": asked.classes, "--repair": asked.repair}
        if given := [option for option, value in {**of_counts, **others}.items() if value]:
            raise CorampError(f"{', '.join(given)}: without --counts; give a file of counts")
        return None
    if missing := [option for option, value in of_counts.items() if value is None]:
        raise CorampError(
            f"{', '.join(missing)}: is missing; give the id of a detector that coramp counts lists"
        )
    return CountsChoice(
        asked.counts,
        asked.mainline_detector or "",
        asked.ramp_detector or "",
        stations_of(asked.detector),
        classes_of(asked.classes),
        asked.repair,
    )
