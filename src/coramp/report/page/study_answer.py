"""What a study of one's own says, in sentences: who loses least, by how much, and how sure."""

from collections.abc import Iterator, Mapping
from typing import Any

import polars as pl

from coramp.report.style import look_of
from coramp.scenarios.toml_files import override_text
from coramp.studies.overrides import overrides_of, scenario_value
from coramp.studies.paired import Cell, Difference, differences
from coramp.studies.shown import shared_flows
from coramp.studies.statistics import estimate
from coramp.studies.tables import with_interval

MOST_SETTINGS = 4


def own_answer(good: pl.DataFrame, scenario: Mapping[str, Any] | None = None) -> str:
    """Returns for each setting who loses least and by how much, at the highest flow of all.

    Differences are those on the same arrivals. ``scenario`` is the content of the study's scenario:
    where a run sets nothing, its values are told of what others set.
    """
    mainline, ramp = shared_flows(good)[-1]
    at = good.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    apart = {(d.less, d.more): d for d in differences(at)}
    settings = at["overrides"].unique(maintain_order=True).to_list()
    own = _own_setting(at, scenario or {})
    told = [_sentence(at, setting, own, apart) for setting in settings[:MOST_SETTINGS]]
    more = len(settings) - len(told)
    rest = f" {more} more settings are in the tables." if more > 0 else ""
    return f"At {mainline:g} + {ramp:g} veh/h, on the same arrivals: {' '.join(told)}{rest}"


def _own_setting(at: pl.DataFrame, scenario: Mapping[str, Any]) -> str:
    """What the scenario itself has of all that other runs set, as ``KEY=VALUE``."""
    keys = sorted({key for row in at.iter_rows(named=True) for key in overrides_of(row)})
    own = {key: scenario_value(scenario, key) for key in keys}
    return ", ".join(override_text(key, value) for key, value in own.items() if value is not None)


def _sentence(
    at: pl.DataFrame,
    setting: str | None,
    own: str,
    apart: dict[tuple[Cell, Cell], Difference],
) -> str:
    """One setting: the cell with the least mean delay of all, then the others after it."""
    delays_s = dict(_cells(at, setting))
    best, *others = sorted(delays_s, key=lambda cell: estimate(delays_s[cell]).mean)
    named = setting or own
    where = f"with {named} " if named else ""
    parts = [f"{_label(best)} loses least, {with_interval(estimate(delays_s[best]))} s a vehicle"]
    for cell in others:
        found = apart.get((best, cell))
        if found is not None:
            sure = "" if found.told_apart else ", which may be chance"
            parts.append(f"{_label(cell)} {with_interval(found.by_s[0])} s more{sure}")
        else:
            parts.append(f"{_label(cell)} {with_interval(estimate(delays_s[cell]))} s")
    text = f"{where}{'; '.join(parts)}."
    return text[0].upper() + text[1:]


def _cells(at: pl.DataFrame, setting: str | None) -> Iterator[tuple[Cell, list[float]]]:
    here = at.filter(pl.col("overrides").eq_missing(pl.lit(setting, pl.String)))
    for (strategy, drivers), group in here.group_by(["strategy", "drivers"], maintain_order=True):
        cell = Cell(str(strategy), None if drivers is None else str(drivers), setting)
        yield cell, group["delay_s"].drop_nulls().to_list()


def _label(cell: Cell) -> str:
    return look_of(*cell.who).label
