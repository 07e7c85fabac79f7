"""Coordination beside automation alone at the same share and gaps: delay against hard braking."""

from collections.abc import Sequence

from coramp.studies.penetration_runs import Cell
from coramp.studies.tables import Table, number, with_interval

BOTH = "both"
NOTE = (
    "Delay of all in s, mean over seeds; slower: the difference on the same arrivals with its 95 % "
    "interval, below zero where coordination is faster. Brakings beyond 3 m/s2 are sums over "
    "seeds, of all vehicles and of drivers. Front: who is not worse in both, by the brakings of "
    "all and of drivers."
)
COLUMNS = (
    "drivers",
    "flow (veh/h)",
    "gap (s)",
    "share",
    "coordinated",
    "beside",
    "its delay (s)",
    "delay beside (s)",
    "slower by (s)",
    "its brakings, all",
    "beside, all",
    "% of those",
    "its brakings, drivers",
    "beside, drivers",
    "front, all",
    "front, drivers",
)
IMPORTANT = ("flow (veh/h)", "gap (s)", "share", "beside", "slower by (s)", "% of those")


def pareto_table(cells: Sequence[Cell]) -> Table | None:
    """Returns each coordinated cell beside automation alone in the same traffic, None for none.

    They have the same gap and share too.
    """
    alone = [cell for cell in cells if not cell.vehicles.coordinated]
    rows = [
        _row(own, other)
        for own in cells
        if own.vehicles.coordinated
        for other in alone
        if _alike(own, other)
    ]
    title = "Delay against hard braking, coordinated and alone"
    return Table(title, COLUMNS, tuple(rows), (NOTE,), IMPORTANT) if rows else None


def front_of(own: tuple[float, float], other: tuple[float, float]) -> tuple[bool, bool]:
    """Returns whether each of two is on the front: no worse in one thing, or better in another."""
    return not _beaten(own, other), not _beaten(other, own)


def _beaten(own: tuple[float, float], other: tuple[float, float]) -> bool:
    return other != own and other[0] <= own[0] and other[1] <= own[1]


def _alike(own: Cell, other: Cell) -> bool:
    same = own.traffic == other.traffic and own.share == other.share
    return same and own.vehicles.time_gap_s == other.vehicles.time_gap_s


def _row(own: Cell, other: Cell) -> tuple[str, ...]:
    mine, theirs = own.total("hard_brakings_3") or 0, other.total("hard_brakings_3") or 0
    return (
        own.traffic.drivers,
        own.traffic.name,
        number(own.vehicles.time_gap_s, 1),
        f"{100.0 * own.share:g} %",
        own.vehicles.who,
        other.vehicles.who,
        with_interval(own.mean("delay_s")),
        with_interval(other.mean("delay_s")),
        with_interval(own.slower_s(other)),
        str(mine),
        str(theirs),
        number(100.0 * mine / theirs, 0) if theirs else "-",
        str(own.total("driver_hard_brakings_3") or 0),
        str(other.total("driver_hard_brakings_3") or 0),
        _front(own, other, "hard_brakings_3"),
        _front(own, other, "driver_hard_brakings_3"),
    )


def _front(own: Cell, other: Cell, column: str) -> str:
    first, second = (
        (cell.mean("delay_s").mean, float(cell.total(column) or 0)) for cell in (own, other)
    )
    is_own, is_other = front_of(first, second)
    if is_own and is_other:
        return BOTH
    return own.vehicles.who if is_own else other.vehicles.who
