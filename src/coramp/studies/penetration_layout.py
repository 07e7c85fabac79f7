"""From which share of automated vehicles coordination pays, for whom, and what it costs others."""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import polars as pl

from coramp.studies.metric_labels import label_of
from coramp.studies.penetration_pareto import pareto_table
from coramp.studies.penetration_runs import (
    Cell,
    Traffic,
    Vehicles,
    cells_of,
    cells_without,
    is_sure,
)
from coramp.studies.statistics import Estimate
from coramp.studies.tables import Table, number, with_interval

PAYS = (
    "The smallest share from which on, at every share that was run, the difference from the same "
    "drivers without automated vehicles is sure: seed by seed on the same arrivals, its 95 % "
    "interval leaves out zero. For drivers it is between what a driver loses and what all lose "
    "there: who is automated is drawn at random. Nowhere: not even at the largest share."
)
BROKEN = "No breakdown: from there on no seed has a stream that loses more than 5 s on average."
RATIO = (
    "Ratio of sums over seeds, in %, with its 95 % interval; 0 %: the figure itself, mean over "
    "seeds. A dash was not run."
)
KINDS_NOTE = (
    "Means over seeds with 95 % intervals. Drivers gain: by how much less a driver loses than all "
    "lose where nobody is automated, on the same arrivals; below zero drivers pay."
)
EVENTS_NOTE = (
    "Speeds and fuel are means over seeds, the rest are sums. Brakings: 0.2 s or more beyond "
    "3 m/s2. Nearer than promised: automated vehicles that came nearer to a leader than they can "
    "stop, or came in nearer before a driver than he brakes for in comfort; those alone promise "
    "nothing. Assumptions: drivers who cut in nearer than that or braked beyond 6 m/s2."
)
COLUMNS = ("drivers", "flow (veh/h)", "gap (s)", "automated vehicles")
COUNTS = (
    "collisions_by_automated",
    "collisions_by_driver",
    "collisions_among_drivers",
)


class Series(NamedTuple):
    """The cells of one traffic and vehicles over the share, and that without automated ones."""

    traffic: Traffic
    vehicles: Vehicles
    cells: tuple[Cell, ...]
    without: Cell

    @property
    def names(self) -> tuple[str, str, str, str]:
        """Drivers, flow, gap and who decides."""
        gap = number(self.vehicles.time_gap_s, 1)
        return self.traffic.drivers, self.traffic.name, gap, self.vehicles.who

    def pays_from(self, pays: Callable[[Cell], bool]) -> float | None:
        """Returns the share from which on every cell pays, None where the last does not."""
        found = None
        for cell in reversed(self.cells):
            if not pays(cell):
                break
            found = cell.share
        return found


def series_of(good: pl.DataFrame) -> list[Series]:
    """Returns the runs of a study as lines over the share."""
    cells = cells_of(good)
    without = cells_without(cells)
    groups = groupby(cells, key=lambda cell: (cell.traffic, cell.vehicles))
    return [Series(*key, tuple(group), without[key[0]]) for key, group in groups]


def penetration_tables(good: pl.DataFrame) -> list[Table]:
    """Returns from which share it pays, delays and brakings by share, by kind, and the front."""
    found = series_of(good)
    if not found:
        return []
    tables = [
        pays_table(found),
        _by_share(
            "Delay of all over that without automated vehicles (%)",
            found,
            lambda cell: cell.delay_share,
            lambda cell: f"{with_interval(cell.mean('delay_s'))} s",
        ),
        _by_share(
            "Brakings of drivers beyond 3 m/s2 over those without automated vehicles (%)",
            found,
            lambda cell: cell.driver_brakings_share,
            lambda cell: with_interval(cell.mean("driver_hard_brakings_3"), 0),
        ),
        _breakdowns(found),
    ]
    pareto = pareto_table([cell for series in found for cell in series.cells])
    return [*tables, *([pareto] if pareto is not None else []), _kinds(found), _events(found)]


def pays_table(found: Sequence[Series]) -> Table:
    """Returns from which share each pays for all, for drivers, and nothing breaks down."""
    rows = tuple(
        (
            *series.names,
            _share(series.pays_from(lambda cell: is_sure(cell.saved_s))),
            _drivers_gain_from(series),
            _unbroken_from(series),
        )
        for series in found
    )
    columns = (*COLUMNS, "all lose less from", "drivers lose less from", "no breakdown from")
    return Table("From which share it pays", columns, rows, (PAYS, BROKEN))


def _drivers_gain_from(series: Series) -> str:
    """Where there are drivers: at 100 % there is nobody to gain."""
    among = series._replace(cells=tuple(cell for cell in series.cells if cell.share < 1.0))
    if not among.cells:
        return "-"
    return _share(among.pays_from(lambda cell: is_sure(cell.drivers_saved_s)))


def _unbroken_from(series: Series) -> str:
    if not series.without.broken and not any(cell.broken for cell in series.cells):
        return "0 %"
    return _share(series.pays_from(lambda cell: not cell.broken))


def _share(share: float | None) -> str:
    return "nowhere" if share is None else f"{100.0 * share:g} %"


def _shares(found: Sequence[Series]) -> list[float]:
    return sorted({cell.share for series in found for cell in series.cells})


def _by_share(
    title: str,
    found: Sequence[Series],
    value_of: Callable[[Cell], Estimate],
    without: Callable[[Cell], str],
) -> Table:
    """One row a line, a column a share: what is asked for beside the figure at 0."""
    shares = _shares(found)
    rows = []
    for series in found:
        cells = {cell.share: with_interval(value_of(cell), 0) for cell in series.cells}
        rows.append((*series.names, without(series.without), *_filled(cells, shares)))
    columns = (*COLUMNS, "0 %", *map(_share, shares))
    return Table(title, columns, tuple(rows), (RATIO,))


def _filled(cells: dict[float, str], shares: Sequence[float]) -> Iterator[str]:
    return (cells.get(share, "-") for share in shares)


def _breakdowns(found: Sequence[Series]) -> Table:
    """Of the lines that break down somewhere, with how many seeds at each share."""
    shares = [0.0, *_shares(found)]
    rows = []
    for series in found:
        every = (series.without, *series.cells)
        if any(cell.broken for cell in every):
            cells = {cell.share: f"{cell.broken} of {len(cell.runs)}" for cell in every}
            rows.append((*series.names, *_filled(cells, shares)))
    columns = (*COLUMNS, *(_share(share) for share in shares))
    note = (
        "Seeds with which a stream lost more than 5 s on average or anyone was left. Lines "
        "without any are left out."
    )
    return Table("Seeds that broke down", columns, tuple(rows), (note,))


def _with_shares(
    found: Sequence[Series], figures: Callable[[Cell], tuple[str, ...]]
) -> tuple[tuple[str, ...], ...]:
    """One row a cell, with that of nobody automated before the first of its traffic."""
    rows: list[tuple[str, ...]] = []
    for traffic, lines in groupby(found, key=lambda series: series.traffic):
        every = list(lines)
        rows.append((traffic.drivers, traffic.name, "-", "none", "0 %", *figures(every[0].without)))
        rows += [
            (*series.names, _share(cell.share), *figures(cell))
            for series in every
            for cell in series.cells
        ]
    return tuple(rows)


def _kinds(found: Sequence[Series]) -> Table:
    columns = (
        *COLUMNS,
        "share",
        label_of("delay_s"),
        label_of("mainline_delay_s"),
        label_of("ramp_delay_s"),
        label_of("automated_delay_s"),
        label_of("driver_delay_s"),
        "drivers gain (s)",
    )
    return Table("Who gains", columns, _with_shares(found, _delays), (KINDS_NOTE,))


def _delays(cell: Cell) -> tuple[str, ...]:
    names = ("delay_s", "mainline_delay_s", "ramp_delay_s", "automated_delay_s", "driver_delay_s")
    gain = with_interval(cell.drivers_saved_s) if 0.0 < cell.share < 1.0 else "-"
    return (*(with_interval(cell.mean(name)) for name in names), gain)


def _events(found: Sequence[Series]) -> Table:
    columns = (
        *COLUMNS,
        "share",
        label_of("mainline_speed_mps"),
        label_of("ramp_speed_mps"),
        label_of("fuel_ml"),
        "brakings, automated",
        "brakings, drivers",
        "stopped",
        "of them on the ramp",
        "collisions by automated, by driver, among drivers",
        "nearer than promised",
        "assumptions",
    )
    title = "Speed, fuel, stops, brakings and collisions"
    return Table(title, columns, _with_shares(found, _figures), (EVENTS_NOTE,))


def _figures(cell: Cell) -> tuple[str, ...]:
    return (
        with_interval(cell.mean("mainline_speed_mps")),
        with_interval(cell.mean("ramp_speed_mps")),
        number(_fuel_ml(cell)),
        _count(cell.total("automated_hard_brakings_3")),
        _count(cell.total("driver_hard_brakings_3")),
        _count(cell.total("stops")),
        _count(cell.total("ramp_stops")),
        _collisions(cell),
        _count(cell.total("automated_violations")),
        _count(cell.total("broken_assumptions")),
    )


def _fuel_ml(cell: Cell) -> float:
    vehicles = sum(_vehicles(run) for run in cell.runs.values())
    return 1000.0 * math.fsum(run["fuel_l"] for run in cell.runs.values()) / max(1, vehicles)


def _vehicles(run: Any) -> int:
    return int(run["vehicles_mainline"] + run["vehicles_ramp"])


def _collisions(cell: Cell) -> str:
    """By cause; where nobody is automated all are among drivers, where nobody drives by none."""
    by_cause = [cell.total(column) for column in COUNTS]
    every = cell.total("collisions") or 0
    if all(count is None for count in by_cause):
        by_cause = [0, 0, every] if cell.share == 0.0 else [every, 0, 0]
    return ", ".join(str(count or 0) for count in by_cause)


def _count(count: int | None) -> str:
    return "-" if count is None else str(count)
