"""In which world a studio's runs hold: who is automated, who drives beside, what goes wrong."""

from collections.abc import Iterator, Sequence

from coramp.records.run import RunRecords
from coramp.records.schemas import MIXED_METRICS, Row
from coramp.records.world_told import told_of_world
from coramp.report.page.shown import title_of
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.scenarios.world_sections import PRESETS, TABLES
from coramp.strategies.registry import strategy_named
from coramp.studies.metric_labels import label_of, typeset
from coramp.studies.tables import Table, number

WORLD = "world"
"""The table that names the preset."""
OF_THE_ROAD = ("road", "behaviour", "incidents")
"""The tables that act on drivers too, and on automated vehicles that nobody coordinates."""
PERFECT = "none"
"""The preset that stands for none."""
PRESET_WORDS = {
    PERFECT: "perfect",
    "mild": "mild: a good network",
    "hard": "hard: a bad network, slow vehicles",
    "rtk-5g": "rtk-5g: positions within 5 cm, private 5G",
    "gnss-its-g5": "gnss-its-g5: satellite positions, ITS-G5",
    "urban-canyon": "urban-canyon: outages between buildings",
    "winter": "winter: packed snow",
}
"""The presets of a scenario's world, in words of a list."""


def preset_words(scenario: Scenario) -> dict[str, str]:
    """Returns the presets in words; without one, the scenario's own tables may still hold."""
    own = scenario.has_faults and scenario.world.preset is None
    return PRESET_WORDS | ({PERFECT: "as in the scenario"} if own else {})


def share_percent(scenario: Scenario) -> float:
    """Returns which share of the vehicles that are expected is automated, in whole per cent."""
    every = automated = 0.0
    for on_ramp, stream in ((False, scenario.mainline), (True, scenario.ramp)):
        for kind in scenario.vehicle_types:
            flow = kind.share_of(on_ramp) * sum(stream.flows_veh_h)
            every += flow
            automated += flow * scenario.automated_share_of(kind.name, on_ramp)
    if every == 0.0:
        return 100.0 * scenario.traffic.share_of(False)
    return float(round(100.0 * automated / every))


def with_share(scenario: Scenario, percent: float) -> Row:
    """Returns what to set so that a share of all vehicles is automated, of each stream and type."""
    share = percent / 100.0
    found: Row = {}
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
    faults = _faults(run.scenario)
    if faults and not _coordinated(run):
        faults += f", of which {_felt_alone(run.scenario)}"
    return f"{_kinds(run)}; {faults or 'a perfect world'}{f' ({happened})' if happened else ''}"


def _coordinated(run: RunRecords) -> bool:
    return strategy_named(run.summary["strategy"]).cooperative


def _felt_alone(scenario: Scenario) -> str:
    """What SUMO's own vehicles feel of a world that fails; they send nothing and obey nobody."""
    felt = [f"[{table}]" for table in OF_THE_ROAD if not getattr(scenario, table).is_perfect]
    return f"{' and '.join(felt) or 'nothing'} reaches vehicles that nobody coordinates"


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
    share = f"share of {share_percent(run.scenario):g} %"
    return f"{share}, {automated} of {every} vehicles automated, the others with {drivers}"


def _faults(scenario: Scenario) -> str:
    """What of the world is not perfect, empty where nothing is."""
    preset = scenario.world.preset
    of_preset = {WORLD, *PRESETS.get(preset or "", ())}
    own = [t for t in TABLES if t not in of_preset and not getattr(scenario, t).is_perfect]
    named = [f"preset {preset}"] if preset else []
    return ", ".join([*named, *(f"[{table}]" for table in own)])


def by_kind(runs: Sequence[RunRecords]) -> Table | None:
    """Returns what automated vehicles and drivers get of each run, None where no run has both."""
    if not any(run.is_mixed for run in runs):
        return None
    columns = [column for run in runs for column in _kinds_of(run)]
    names = (
        *("vehicles", "delay (s)", "brakings beyond 3 m/s²"),
        *("collisions caused", "of these, among drivers"),
    )
    rows = tuple(zip(names, *(cells for _, cells in columns), strict=True))
    return Table("Figures by kind of vehicle", ("what", *(title for title, _ in columns)), rows)


def _kinds_of(run: RunRecords) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Each kind of vehicle of a run: what its column is called, and its figures."""
    row, every, title = run.summary, run.vehicles.height, title_of(run)
    if not run.is_mixed:
        alone = row["drivers"] is not None and not row["automated_vehicles"]
        among = row["collisions"] if alone else None
        whole = (row["delay_s"], row["hard_brakings_3"], row["collisions"])
        yield f"{title}: all", _cells(every, *whole, among)
        return
    automated, caused = row["automated_vehicles"], row["collisions_by_automated"]
    among = row["collisions_among_drivers"]
    yield f"{title}: automated", _cells(automated, *_figures_of("automated", row), caused)
    caused = row["collisions_by_driver"] + among
    yield f"{title}: drivers", _cells(every - automated, *_figures_of("driver", row), caused, among)


def _figures_of(kind: str, row: Row) -> tuple[float | None, int | None]:
    return row[f"{kind}_delay_s"], row[f"{kind}_hard_brakings_3"]


def _cells(
    vehicles: int,
    delay_s: float | None,
    brakings: int | None,
    caused: int | None = None,
    among: int | None = None,
) -> tuple[str, ...]:
    counts = (number(brakings, 0), number(caused, 0), number(among, 0))
    return number(vehicles, 0), number(delay_s), *counts


def folded(table: Table) -> tuple[Table, Table]:
    """Returns the figures that every run has, and those that only runs among drivers have."""
    titles = {typeset(label_of(name)) for name in MIXED_METRICS}
    of_kinds = tuple(row for row in table.rows if row[0] in titles)
    others = tuple(row for row in table.rows if row[0] not in titles)
    title = "More figures of runs in SUMO: kinds of vehicles, messages, conflicts"
    return Table(table.title, table.columns, others), Table(title, table.columns, of_kinds)
