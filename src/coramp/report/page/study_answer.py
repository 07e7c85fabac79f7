"""What a study says first: by setting who loses how much, and by how much the best is better."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import polars as pl

from coramp.report.style import look_of
from coramp.studies.hostile_layout import collisions_table
from coramp.studies.hostile_runs import DRIVERS_ALONE, cells_of
from coramp.studies.overrides import keys_set, overrides_of, scenario_value
from coramp.studies.paired import Cell, Difference, differences
from coramp.studies.penetration_layout import pays_table, series_of
from coramp.studies.setting_words import GAPS, gaps_text, settings_text
from coramp.studies.shown import SHOWN_DRIVERS, plain, shared_flows
from coramp.studies.statistics import estimate
from coramp.studies.tables import with_interval

MOST_SETTINGS = 6
MOST_SHARES = 12
OF_DRIVERS = ("tau_s", "min_gap_m")
"""Of a population of drivers the gaps that it keeps, as ``GAPS`` are those of the others."""


class Answer(NamedTuple):
    """A line that says what is told, and an item each with its label, which may be empty."""

    lead: str
    items: tuple[tuple[str, str], ...]
    rest: str = ""


def own_answer(good: pl.DataFrame, scenario: Mapping[str, Any] | None = None) -> Answer:
    """Returns for each setting what each loses and by how much the best is better.

    At the highest flow that most strategies share. Differences are those on the same arrivals.
    ``scenario`` is the content of the study's scenario: where a run sets nothing, its values are
    told of what others set.
    """
    mainline, ramp = shared_flows(good)[-1]
    at = good.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    apart = {(d.less, d.more): d for d in differences(at)}
    settings = at["overrides"].unique(maintain_order=True).to_list()
    items = tuple(
        (_label_of_setting(at, setting, scenario or {}), _item(at, setting, apart, scenario or {}))
        for setting in settings[:MOST_SETTINGS]
    )
    more = len(settings) - len(items)
    rest = f"{more} more settings are in the tables." if more > 0 else ""
    return Answer(_lead(at, mainline, ramp), items, rest)


def answered_differences(good: pl.DataFrame) -> list[Difference]:
    """Returns the differences between strategies with one setting that ``own_answer`` tells."""
    if good.is_empty():
        return []
    mainline, ramp = shared_flows(good)[-1]
    at = good.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    best = {}
    for setting in at["overrides"].unique(maintain_order=True).to_list()[:MOST_SETTINGS]:
        delays_s = {cell: estimate(values).mean for cell, values in _cells(at, setting)}
        best[setting] = min(delays_s, key=lambda cell: delays_s[cell])
    return [
        found
        for found in differences(at)
        if found.less.overrides == found.more.overrides
        and found.less == best.get(found.less.overrides)
    ]


def _lead(at: pl.DataFrame, mainline: float, ramp: float) -> str:
    seeds = at["seed"].n_unique()
    means = f"mean over {seeds} seeds ± 95 % interval" if seeds > 1 else "one seed, no interval"
    return f"At {mainline:g} + {ramp:g} veh/h, seconds that a vehicle loses ({means}):"


def _label_of_setting(at: pl.DataFrame, setting: str | None, scenario: Mapping[str, Any]) -> str:
    """A setting in words; of what this one does not set and others do, the scenario's own."""
    rows = at.filter(pl.col("overrides").eq_missing(pl.lit(setting, pl.String)))
    here = overrides_of(rows.row(0, named=True))
    keys = keys_set(at)
    values = {key: here.get(key, scenario_value(scenario, key)) for key in keys}
    known = {key: value for key, value in values.items() if value is not None}
    return settings_text(known, scenario) or ("as in the scenario" if keys else "")


def _values_in(
    at: pl.DataFrame, setting: str | None, scenario: Mapping[str, Any]
) -> Callable[[str], Any]:
    """What a dotted key is with a setting: set, or the scenario's own; None if not known."""
    rows = at.filter(pl.col("overrides").eq_missing(pl.lit(setting, pl.String)))
    here = overrides_of(rows.row(0, named=True))
    return lambda key: here.get(key, scenario_value(scenario, key))


def _item(
    at: pl.DataFrame,
    setting: str | None,
    apart: Mapping[tuple[Cell, Cell], Difference],
    scenario: Mapping[str, Any],
) -> str:
    """What each cell of a setting loses, the best first, with its lead over the others."""
    delays_s = dict(_cells(at, setting))
    ordered = sorted(delays_s, key=lambda cell: estimate(delays_s[cell]).mean)
    best = ordered[0]
    value = _values_in(at, setting, scenario)
    told = [
        f"{_label(cell)}{_kept(cell, value)} {with_interval(estimate(delays_s[cell]))} s"
        for cell in ordered
    ]
    ahead = [
        f"by {with_interval(found.by_s[0])} s over {_label(cell)}"
        + (" at unequal gaps" if _unequal(best, cell, value) else "")
        + ("" if found.told_apart else " (may be chance)")
        for cell in ordered[1:]
        if (found := apart.get((best, cell))) is not None
    ]
    lead = f" {_label(best).capitalize()} is best {', '.join(ahead)}." if ahead else ""
    return f"{', '.join(told)}.{lead}"


def _cells(at: pl.DataFrame, setting: str | None) -> Iterator[tuple[Cell, list[float]]]:
    here = at.filter(pl.col("overrides").eq_missing(pl.lit(setting, pl.String)))
    for _, group in here.group_by(["strategy", "drivers"], maintain_order=True):
        yield Cell.of_run(group.row(0, named=True)), group["delay_s"].drop_nulls().to_list()


def _label(cell: Cell) -> str:
    return look_of(*cell.who).label


def _gaps_kept(cell: Cell, value: Callable[[str], Any]) -> tuple[Any, Any]:
    """Time gap (s), or a list of them, and standstill gap (m) that a cell's vehicles keep."""
    if cell.drivers is None:
        return tuple(map(value, GAPS))
    return tuple(value(f"drivers.{cell.drivers}.{key}") for key in OF_DRIVERS)


def _kept(cell: Cell, value: Callable[[str], Any]) -> str:
    """The gaps that drivers keep, in brackets, if these are known; nothing of others."""
    time_gaps_s, gap_m = _gaps_kept(cell, value)
    if cell.drivers is None or time_gaps_s is None:
        return ""
    if isinstance(time_gaps_s, list):
        low, high = min(time_gaps_s), max(time_gaps_s)
        return f" (who keep {low:g} to {gaps_text(high, gap_m)})"
    return f" (who keep {gaps_text(time_gaps_s, gap_m)})"


def _unequal(one: Cell, other: Cell, value: Callable[[str], Any]) -> bool:
    """Whether vehicles of two cells keep gaps that are known and differ."""
    kept = [_gaps_kept(cell, value) for cell in (one, other)]
    return None not in (*kept[0], *kept[1]) and kept[0] != kept[1]


def layout_answer(good: pl.DataFrame) -> Answer:
    """Returns what each strategy loses on mainline and ramp at the highest flow that all share.

    Strategies with the same figures are named together.
    """
    mainline, ramp = shared_flows(good)[-1]
    at = plain(good).filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    main = at.filter(pl.col("drivers").is_null() | pl.col("drivers").is_in(SHOWN_DRIVERS))
    at = main if main.height else at
    losing: dict[tuple[str, ...], list[str]] = {}
    for (strategy, drivers), group in at.group_by(["strategy", "drivers"], maintain_order=True):
        delays = tuple(
            with_interval(estimate(group[f"{stream}_delay_s"].drop_nulls().to_list()))
            for stream in ("mainline", "ramp")
        )
        name = look_of(str(strategy), str(drivers) if drivers else None).label
        losing.setdefault(delays, []).append(name)
    items = tuple(
        (_listed(names), f"{mainline_s} s on the mainline, {ramp_s} s on the ramp")
        for (mainline_s, ramp_s), names in losing.items()
    )
    return Answer(_lead(at, mainline, ramp), items)


def penetration_answer(good: pl.DataFrame) -> Answer | None:
    """Returns from which share each strategy pays among which drivers, None where none was run."""
    found = [series for series in series_of(good) if series.vehicles.coordinated]
    if not found:
        return None
    rows = pays_table(found).rows
    items = tuple(
        (
            f"{flow} veh/h, {drivers} drivers, {who} at {gap_s} s",
            f"less delay for all {_from(everyone)}, for drivers {_from(own)}; no breakdown "
            + _from(unbroken),
        )
        for drivers, flow, gap_s, who, everyone, own, unbroken in rows
    )
    lead = "The share of automated vehicles from which on coordination pays:"
    more = len(items) - MOST_SHARES
    rest = f"{more} more lines are in the tables." if more > 0 else ""
    return Answer(lead, items[:MOST_SHARES], rest)


def hostile_answer(good: pl.DataFrame) -> Answer | None:
    """Returns the collisions by cause in each world, None where there is nobody automated."""
    cells = [cell for cell in cells_of(good) if cell.line.who != DRIVERS_ALONE]
    if not cells:
        return None
    table = collisions_table(cells)
    items = tuple(
        (
            fault,
            f"{own} by automated vehicles, {driver} by drivers, {among} among drivers; {km} km",
        )
        for fault, _, _, _, _, km, own, driver, among, *_ in table.rows
    )
    return Answer("Collisions, in brackets a million vehicle km with the 95 % interval:", items)


def _from(share: str) -> str:
    return share if share in ("nowhere", "-") else f"from {share}"


def _listed(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last
