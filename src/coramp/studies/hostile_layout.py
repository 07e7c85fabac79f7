"""What a world that fails costs: collisions by cause with exact intervals, delay, conflicts."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

import polars as pl

from coramp.studies.hostile_runs import (
    DRIVERS_ALONE,
    PERFECT,
    Cell,
    Line,
    cells_of,
    counted,
    total,
)
from coramp.studies.rare_layout import rare_tables
from coramp.studies.statistics import rate_interval
from coramp.studies.tables import Table, number, with_interval

MILLION, THOUSAND = 1e6, 1e3
RATES = (
    "All shares and flows of a fault together. In brackets: a million vehicle km, with the exact "
    "95 % interval of a Poisson count; where none happened its one-sided 95 % limit, which is the "
    "rule of three, 3 / km. Collisions are by cause, from positions: who came nearer than "
    "promised, or broke what the other could rely on. Runs in which nobody is a driver and the "
    "world is perfect are planned, and left out."
)
DELAYS = (
    "Ratio of sums over seeds, in %, with its 95 % interval: each run over that with the same "
    "arrivals, share and drivers in a perfect world. In a perfect world: the delay itself (s). At "
    "100 % that is the delay of slots, which plans every vehicle's way. A dash was not run."
)
LOST = "Mean over seeds of the difference from a perfect world on the same arrivals, 95 % interval."
COSTS = (
    "All shares of a flow together. Messages lost in % of those sent. Fallbacks: an automated "
    "vehicle's last command had expired, and it drove by what it has on board. Brakings: 0.2 s or "
    "more beyond 3 m/s2. Stopped: ramp vehicles, in % of all on the ramp."
)
CONFLICTS = (
    "Per 1,000 vehicle km, all shares of a flow together. TTC and DRAC: pairs of neighbours in a "
    "lane that came below or above, once each. PET and severity J: neighbours at a lane change. "
    "PET is from when one's rear leaves a place to when the other's front reaches it; J is Eq. 5 "
    "to 9 with masses, over (0.3 g)^2."
)
CONFLICT_COLUMNS = {
    "conflicts_ttc_3": "TTC < 3 s",
    "conflicts_ttc_1_5": "TTC < 1.5 s",
    "conflicts_ttc_1": "TTC < 1 s",
    "conflicts_drac_2": "DRAC > 2 m/s2",
    "conflicts_drac_3_4": "DRAC > 3.4 m/s2",
    "conflicts_drac_6": "DRAC > 6 m/s2",
    "conflicts_pet_1": "PET < 1 s",
    "conflicts_pet_0_5": "PET < 0.5 s",
    "conflicts_pet_0_2": "PET < 0.2 s",
    "conflicts_j_1": "J > 1",
    "conflicts_j_10": "J > 10",
    "conflicts_j_100": "J > 100",
}
Rows = tuple[tuple[str, ...], ...]


def hostile_tables(good: pl.DataFrame) -> list[Table]:
    """Returns collisions, delays against a perfect world, what else it costs, and conflicts.

    Then rates of rare events, where runs were drawn for these.
    """
    cells = cells_of(good)
    if not cells:
        return rare_tables(good)
    return [
        collisions_table(cells),
        _where_collided(cells),
        _by_share("Delay of all over that in a perfect world (%)", cells, _delay, DELAYS),
        _by_share("Delay lost to faults (s)", _faulty(cells), _lost, LOST),
        _costs(cells),
        _conflicts(cells),
        *rare_tables(good),
    ]


def _faulty(cells: Sequence[Cell]) -> list[Cell]:
    return [cell for cell in cells if cell.line.fault != PERFECT]


def collisions_table(cells: Sequence[Cell]) -> Table:
    """Returns how far vehicles drove in each world, and collisions by cause with intervals."""
    rows = []
    for (who, drivers, setting, fault), own in _grouped(cells, _of_fault):
        found = counted(own)
        if found.runs:
            told = (_rate(count, found.vehicle_km) for count in found.by_cause)
            kept = _sums(own, ("automated_violations", "broken_assumptions"))
            km = number(found.vehicle_km, 0)
            rows.append((fault, who, drivers, setting, str(found.runs), km, *told, *kept))
    columns = (
        *("fault", "vehicles", "drivers", "setting", "runs", "vehicle km"),
        *("collisions by automated", "by driver", "among drivers"),
        *("nearer than promised", "assumptions broken"),
    )
    importance = ("fault", "vehicles", *columns[5:])
    return Table("Collisions by cause", columns, tuple(rows), (RATES,), importance)


def _rate(count: int, vehicle_km: float) -> str:
    """A count with its rate a million vehicle km and the exact interval of this."""
    low, high = (MILLION * limit for limit in rate_interval(count, vehicle_km))
    if count == 0:
        return f"0 (below {number(high, 0)})"
    return f"{count} ({number(MILLION * count / vehicle_km, 0)}: {low:.0f} to {high:.0f})"


def _where_collided(cells: Sequence[Cell]) -> Table:
    """The cells in which vehicles collided, or automated ones broke a promise."""
    rows = []
    for cell in cells:
        found = counted([cell])
        unkept = total([cell], "automated_violations") or 0
        if any(found.by_cause) or unkept:
            causes = (str(count) for count in found.by_cause)
            rows.append((*_names(cell.line), _share(cell.share), *causes, str(unkept)))
    columns = (
        *NAMES,
        *("share", "collisions by automated", "by driver", "among drivers"),
        "nearer than promised",
    )
    note = "Sums over seeds. Lines without any are left out."
    return Table("Where vehicles collided or promises broke", columns, tuple(rows), (note,))


NAMES = ("fault", "vehicles", "drivers", "setting", "flow (veh/h)")


def _names(line: Line) -> tuple[str, ...]:
    return line.fault, line.who, line.drivers, line.setting, line.flow_name


def _of_fault(cell: Cell) -> tuple[str, ...]:
    line = cell.line
    return line.who, line.drivers, line.setting, line.fault


def _grouped(
    cells: Sequence[Cell], key: Callable[[Cell], tuple[str, ...]]
) -> Iterator[tuple[tuple[str, ...], list[Cell]]]:
    return ((found, list(own)) for found, own in groupby(cells, key=key))


def _share(share: float) -> str:
    return f"{100.0 * share:g} %"


def _by_share(title: str, cells: Sequence[Cell], told: Callable[[Cell], str], note: str) -> Table:
    """One row a line, a column a share."""
    shares = sorted({cell.share for cell in cells})
    rows = []
    for line, own in groupby(cells, key=lambda cell: cell.line):
        found = {cell.share: told(cell) for cell in own}
        rows.append((*_names(line), *(found.get(share, "-") for share in shares)))
    return Table(title, (*NAMES, *map(_share, shares)), tuple(rows), (note,))


def _delay(cell: Cell) -> str:
    if cell.line.fault == PERFECT:
        return f"{with_interval(cell.delay)} s"
    return with_interval(cell.delay_share, 0)


def _lost(cell: Cell) -> str:
    return with_interval(cell.lost_s)


def _sums(cells: Sequence[Cell], columns: Sequence[str]) -> Iterator[str]:
    found = (total(cells, column) for column in columns)
    return ("-" if count is None else str(count) for count in found)


def _costs(cells: Sequence[Cell]) -> Table:
    columns = (
        *NAMES,
        *("reports lost (%)", "commands lost (%)", "fallbacks, per 1,000 vehicles"),
        *("brakings of automated, per 1,000 vehicles", "of drivers", "stopped on the ramp (%)"),
    )
    rows = tuple((*_names(line), *_cost(own)) for line, own in _by_line(cells))
    return Table("Messages, fallbacks, braking and stops", columns, rows, (COSTS,))


def _by_line(cells: Sequence[Cell]) -> Iterator[tuple[Line, list[Cell]]]:
    return ((line, list(own)) for line, own in groupby(cells, key=lambda cell: cell.line))


def _cost(cells: Sequence[Cell]) -> Iterator[str]:
    """Runs without figures by kind, which all are of one kind, do not count, but drivers alone."""
    alone = cells[0].line.who == DRIVERS_ALONE
    mixed = [c for c in cells if alone or total([c], "automated_vehicles") is not None]
    vehicles = (total(mixed, "vehicles_mainline") or 0) + (total(mixed, "vehicles_ramp") or 0)
    yield _part(mixed, "reports_lost", total(mixed, "reports_sent"), 100.0)
    yield _part(mixed, "commands_lost", total(mixed, "commands_sent"), 100.0)
    yield _part(mixed, "fallbacks", vehicles, THOUSAND)
    yield _part(mixed, "automated_hard_brakings_3", vehicles, THOUSAND)
    of_drivers = "hard_brakings_3" if alone else "driver_hard_brakings_3"
    yield _part(mixed, of_drivers, vehicles, THOUSAND)
    stopped = "stops" if alone else "ramp_stops"
    yield "-" if alone else _part(mixed, stopped, total(mixed, "vehicles_ramp"), 100.0)


def _part(cells: Sequence[Cell], column: str, over: int | None, scale: float) -> str:
    found = total(cells, column)
    return "-" if found is None or not over else number(scale * found / over, 1)


def _conflicts(cells: Sequence[Cell]) -> Table:
    rows = []
    for line, own in _by_line(cells):
        found = conflict_rates(own)
        if found:
            rows.append((*_names(line), *(number(found[name], 1) for name in CONFLICT_COLUMNS)))
    columns = (*NAMES, *CONFLICT_COLUMNS.values())
    return Table("Conflicts by how grave they are", columns, tuple(rows), (CONFLICTS,))


def conflict_rates(cells: Sequence[Cell]) -> dict[str, float]:
    """Returns conflicts of each kind per 1,000 vehicle km, nothing where runs have none."""
    runs = [run for cell in cells for run in cell.runs.values()]
    runs = [run for run in runs if run["conflicts_ttc_3"] is not None]
    driven_km = sum(run["vehicle_km"] for run in runs)
    if driven_km == 0.0:
        return {}
    return {
        name: THOUSAND * sum(run[name] for run in runs) / driven_km for name in CONFLICT_COLUMNS
    }
