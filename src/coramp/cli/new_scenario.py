"""What ``coramp new-scenario`` was asked for, as the content of a scenario."""

from pathlib import Path
from typing import Any, NamedTuple

from coramp.cli.scenario_files import (
    new_scenario_text,
    write_new_scenario,
    write_new_scenario_of_osm,
)
from coramp.errors import CorampError
from coramp.records.files import write_text
from coramp.scenarios.counted import (
    CountsChoice,
    classes_of,
    road_of,
    stations_of,
    with_counts_tables,
)

ROAD = "paper"
"""The scenario whose road one with counts has where nothing is said."""


class Asked(NamedTuple):
    """The options of the command; None where one is left out."""

    ramp: list[str]
    net: Path | None
    osm: Path | None
    road: str | None
    counts: Path | None
    mainline_detector: str | None
    ramp_detector: str | None
    detector: list[str]
    classes: list[str]
    repair: bool


def write_asked(asked: Asked, target: Path) -> list[str]:
    """Writes the scenario that was asked for; returns a line for each repair of its counts.

    Raises CorampError for options that do not go together, and for what they name and is not there.
    """
    choice = _choice(asked)
    told: list[str] = []

    def counted(data: dict[str, Any]) -> dict[str, Any]:
        if choice is None:
            return data
        result, repairs = with_counts_tables(data, choice, target.parent)
        told.extend(repair.line(str(choice.file)) for repair in repairs)
        return result

    _check_road(asked)
    if asked.net is not None:
        write_new_scenario(target, asked.net, asked.ramp, counted)
    elif asked.osm is not None:
        write_new_scenario_of_osm(target, asked.osm, asked.ramp, counted)
    else:
        write_text(target, new_scenario_text(counted(road_of(asked.road or ROAD)), target))
    return told


def _check_road(asked: Asked) -> None:
    if asked.net is not None and asked.osm is not None:
        raise CorampError("--net, --osm: allowed is one of them: a network, or what to make it of")
    in_network = asked.net is not None or asked.osm is not None
    if not in_network and asked.counts is None:
        raise CorampError("--net, --osm: allowed is one of them, or --counts alone; none is given")
    if not in_network and asked.ramp:
        raise CorampError("--ramp: is an on-ramp of a network; allowed with --net or --osm")
    if len(asked.ramp) > 1 and asked.counts is not None:
        raise CorampError("--counts: beside several --ramp; allowed is one on-ramp")
    if in_network and asked.road is not None:
        raise CorampError("--road: beside a network; allowed is one of them")


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
