"""In which world a studio's runs hold: who is automated, who drives beside, what goes wrong."""

from collections.abc import Iterator, Sequence

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.records.world_told import told_of_world
from coramp.report.page.shown import title_of
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.scenarios.world_sections import PRESETS, TABLES
from coramp.studies.tables import Table, number

PERFECT = "none"
"""The preset that stands for none."""
PRESET_WORDS = {
    PERFECT: "none",
    "mild": "mild: a good network",
    "hard": "hard: a bad network, slow vehicles",
    "rtk-5g": "rtk-5g: positions within 5 cm, private 5G",
    "gnss-its-g5": "gnss-its-g5: satellite positions, ITS-G5",
    "urban-canyon": "urban-canyon: outages between buildings",
    "winter": "winter: packed snow",
}
"""The presets of a scenario's world, in words of a list."""


def share_percent(scenario: Scenario) -> float:
    """Returns which share of the vehicles that are expected is automated, in whole per cent."""
    expected = [
        (kind.share_of(on_ramp) * sum(stream.flows_veh_h), kind.name, on_ramp)
        for on_ramp, stream in ((False, scenario.mainline), (True, scenario.ramp))
        for kind in scenario.vehicle_types
    ]
    every = sum(flow for flow, _, _ in expected)
    if every == 0.0:
        return 100.0 * scenario.traffic.share_of(False)
    automated = sum(flow * scenario.automated_share_of(*of) for flow, *of in expected)
    return float(round(100.0 * automated / every))


def with_share(scenario: Scenario, percent: float) -> Row:
    """Returns what to set so that a share of all vehicles is automated, of each stream and type."""
    share, found = percent / 100.0, {}
    for stream in STREAMS:
        key = f"{stream}_automated_share"
        if getattr(scenario.traffic, key) is not None:
            found[f"traffic.{key}"] = share
    if any(kind.automated_share is not None for kind in scenario.vehicle_types):
        found["vehicle"] = [
            kind.model_dump(mode="json", exclude_none=True, exclude={"automated_share"})
            for kind in scenario.vehicle_types
        ]
    return {"traffic.automated_share": share, **found}


def world_of(run: RunRecords) -> str:
    """Returns in words in which world the figures of a run hold, and what happened in it."""
    happened = told_of_world(run)
    return f"{_kinds(run)}; {_faults(run.scenario)}{f' ({happened})' if happened else ''}"


def _kinds(run: RunRecords) -> str:
    row, every = run.summary, run.vehicles.height
    drivers = f"{row['drivers']} drivers"
    if row["drivers"] is None:
        return f"all {every} vehicles automated"
    automated = row["automated_vehicles"]
    if not automated:
        return f"all {every} vehicles with {drivers}"
    if automated == every:
        return f"all {every} vehicles automated"
    return f"{automated} of {every} vehicles automated, the others with {drivers}"


def _faults(scenario: Scenario) -> str:
    """What of the world is not perfect."""
    tables = [table for table in TABLES if not getattr(scenario, table).is_perfect]
    if not tables:
        return "nothing goes wrong"
    preset = scenario.world.preset
    of_preset = PRESETS.get(preset or "", {})
    named = [f"preset {preset}"] if preset else []
    return ", ".join([*named, *(f"[{table}]" for table in tables if table not in of_preset)])


def by_kind(runs: Sequence[RunRecords]) -> Table | None:
    """Returns what automated vehicles and drivers get of each run, None where no run has both."""
    if not any(run.is_mixed for run in runs):
        return None
    columns = [column for run in runs for column in _kinds_of(run)]
    names = ("vehicles", "delay (s)", "brakings above 3 m/s²", "collisions caused")
    rows = tuple(zip(names, *(cells for _, cells in columns), strict=True))
    return Table("Figures by kind of vehicle", ("what", *(title for title, _ in columns)), rows)


def _kinds_of(run: RunRecords) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Each kind of vehicle of a run: what its column is called, and its figures."""
    row, every, title = run.summary, run.vehicles.height, title_of(run)
    if not run.is_mixed:
        whole = (row["delay_s"], row["hard_brakings_3"], row["collisions"])
        yield f"{title}: all", _cells(every, *whole)
        return
    automated = row["automated_vehicles"]
    for kind, count, collisions in (
        ("automated", automated, row["collisions_by_automated"]),
        (
            "driver",
            every - automated,
            row["collisions_by_driver"] + row["collisions_among_drivers"],
        ),
    ):
        figures = row[f"{kind}_delay_s"], row[f"{kind}_hard_brakings_3"]
        yield f"{title}: {kind}{'s' * (kind == 'driver')}", _cells(count, *figures, collisions)


def _cells(
    vehicles: int, delay_s: float | None, brakings: int | None, collisions: int | None
) -> tuple[str, ...]:
    return (number(vehicles), number(delay_s, 2), number(brakings), number(collisions))
