"""Where each strategy breaks down: the mainline flow by ramp flow, with its interval over seeds."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import polars as pl

from coramp.studies.breakdown import BREAKDOWN_DELAY_S, broke_down
from coramp.studies.lane_breakdown import Key, lane_flows_veh_h
from coramp.studies.overrides import overrides_of
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import Table, number, with_interval

UNITS = {"safety.time_gap_s": "s", "safety.standstill_gap_m": "m"}


@dataclass(frozen=True)
class Breakdown:
    """Where one combination breaks down at one ramp flow, over the seeds.

    ``flows`` are the lowest mainline flows (veh/h) that broke down, one a seed; ``above`` counts
    the seeds with which even the highest flow held, ``below`` those with which the lowest broke.
    ``limit_veh_h`` is what the lane carries of both streams, None for drivers.
    """

    strategy: str
    drivers: str | None
    overrides: str | None
    ramp_veh_h: float
    flows: tuple[float, ...]
    above: int
    below: int
    lowest_veh_h: float
    highest_veh_h: float
    limit_veh_h: float | None = None
    scenario: str = ""
    seeds: tuple[int, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def by_seed(self) -> list[tuple[int, float]]:
        """Seeds with their breakdown flow (veh/h), where it lies within the range."""
        return list(zip(self.seeds, self.flows, strict=True))

    @property
    def estimate(self) -> Estimate:
        """The mean breakdown flow with its interval, where it lies within the range."""
        return estimate(self.flows)

    @property
    def name(self) -> str:
        """The combination in words."""
        gap = gaps_in_words(self.settings)
        if self.drivers is None:
            return f"{self.strategy}, {gap or 'Eq. 1'}"
        own = gap.replace(f"drivers.{self.drivers}.", "")
        return f"{self.strategy} ({self.drivers}){', ' + own if own else ''}"


def gaps_in_words(settings: Mapping[str, Any]) -> str:
    """Returns overrides in words; gaps by their values alone."""
    words = []
    for key, value in settings.items():
        if key in UNITS and not value:
            continue
        override = f"{key}={value}"
        words.append(f"{value} {UNITS[key]}" if key in UNITS else override)
    return ", ".join(sorted(words, key=lambda word: word.endswith(" m")))


def breakdowns(good: pl.DataFrame) -> list[Breakdown]:
    """Returns the breakdown of each combination at each ramp flow."""
    keys = ["strategy", "drivers", "overrides", "ramp_veh_h"]
    return [
        _breakdown(str(key[0]), key[1], key[2], float(key[3]), group)
        for key, group in good.group_by(keys, maintain_order=True)
    ]


def _breakdown(
    strategy: str, drivers: str | None, overrides: str | None, ramp: float, group: pl.DataFrame
) -> Breakdown:
    low, high = _range(group)
    flows: list[float] = []
    seeds: list[int] = []
    above, below = 0, 0
    for (seed,), runs in group.group_by(["seed"], maintain_order=True):
        broken = min(_broken_flows(runs), default=math.inf)
        if broken == low:
            below += 1
        elif broken == math.inf:
            above += 1
        else:
            flows.append(broken)
            seeds.append(int(str(seed)))
    limit_veh_h = group["lane_limit_veh_h"].max() if "lane_limit_veh_h" in group.columns else None
    return Breakdown(
        strategy,
        drivers,
        overrides,
        ramp,
        tuple(flows),
        above,
        below,
        low,
        high,
        limit_veh_h if isinstance(limit_veh_h, float) else None,
        str(group["scenario"][0]),
        tuple(seeds),
        overrides_of(group.row(0, named=True)),
    )


def _range(group: pl.DataFrame) -> tuple[float, float]:
    flows = group["mainline_veh_h"]
    return float(min(flows)), float(max(flows))


def _broken_flows(runs: pl.DataFrame) -> Iterator[float]:
    for run in runs.iter_rows(named=True):
        if broke_down(run):
            yield run["mainline_veh_h"]


def capacity_tables(good: pl.DataFrame, horizon_s: float | None = None) -> list[Table]:
    """Returns each combination's breakdown flow at each ramp flow, then beside the lane's own.

    ``horizon_s`` is the study's, where it sets one.
    """
    return [*_flows(good), *_beside_the_lane(good, horizon_s)]


def _beside_the_lane(good: pl.DataFrame, horizon_s: float | None) -> list[Table]:
    """One row a combination: its breakdown flow over that of the bound, of the seed worst off."""
    lane = lane_flows_veh_h(good, horizon_s)
    found = [b for b in breakdowns(good) if b.drivers is None]
    if not lane or not found:
        return []
    ramps = sorted({b.ramp_veh_h for b in found})
    rows = [
        (f"the bound, {gaps}", *(_lane_cell(lane, overrides, ramp) for ramp in ramps))
        for overrides, gaps in {b.overrides: b.name.partition(", ")[2] for b in found}.items()
    ]
    for name in dict.fromkeys(b.name for b in found):
        cells = {b.ramp_veh_h: _beside_cell(lane, b) for b in found if b.name == name}
        rows.append((name, *(cells.get(ramp, "-") for ramp in ramps)))
    columns = ("strategy, gaps", *(f"ramp {ramp:g}" for ramp in ramps))
    note = (
        "The bound: the mainline flow (veh/h) at which the least mean delay of all vehicles on the "
        f"same arrivals passes {BREAKDOWN_DELAY_S:g} s, mean over seeds. Strategies: their flow at "
        "breakdown as a share of it, of the seed worst off; in brackets mainline and ramp flow "
        "together as a share of what the lane carries, mean over seeds. Above and below: outside "
        "the flows tried."
    )
    return [Table("Breakdown flow beside the lane's own", columns, tuple(rows), (note,))]


def _lane_cell(lane: dict[Key, float], overrides: str | None, ramp_veh_h: float) -> str:
    flows = [
        flow
        for (_, said, ramp, _), flow in lane.items()
        if (said, ramp) == (overrides or "", ramp_veh_h)
    ]
    known = [flow for flow in flows if math.isfinite(flow)]
    return number(sum(known) / len(known), 0) if len(known) == len(flows) and known else "above"


def _beside_cell(lane: dict[Key, float], found: Breakdown) -> str:
    if found.above:
        return "above"
    if found.below:
        return "below"
    shares = [
        flow / lane[found.scenario, found.overrides or "", found.ramp_veh_h, seed]
        for seed, flow in found.by_seed
    ]
    text = f"{100.0 * min(shares):.0f} %"
    if found.limit_veh_h:
        both = sum(found.flows) / len(found.flows) + found.ramp_veh_h
        text += f" ({100.0 * both / found.limit_veh_h:.0f} %)"
    return text


def _flows(good: pl.DataFrame) -> list[Table]:
    found = breakdowns(good)
    ramps = sorted({b.ramp_veh_h for b in found})
    rows = []
    for name in dict.fromkeys(b.name for b in found):
        cells = {b.ramp_veh_h: _cell(b) for b in found if b.name == name}
        limit = max((b.limit_veh_h or math.nan for b in found if b.name == name), default=None)
        rows.append((name, number(limit, 0), *(cells.get(ramp, "-") for ramp in ramps)))
    columns = ("strategy, gaps", "lane carries", *(f"ramp {ramp:g}" for ramp in ramps))
    meaning = (
        "Mainline flow (veh/h) from which on a stream loses more than "
        f"{BREAKDOWN_DELAY_S:g} s on average or anyone is left, by bisection for each seed: mean "
        "with 95 % interval over seeds. Above: not even at the highest flow tried; at or below: "
        "already at the lowest. Bisection takes it that what broke down at a flow does so at all "
        "higher ones."
    )
    carried = (
        "Lane carries: vehicles of both streams an hour at the gaps that are kept, 3600 / h; at a "
        "ramp flow, that less the ramp flow is left for the mainline. A dash for drivers."
    )
    title = "Breakdown flow on the mainline (veh/h)"
    return [Table(title, columns, tuple(rows), (meaning, carried))]


def _cell(found: Breakdown) -> str:
    parts = []
    if found.flows:
        parts.append(with_interval(found.estimate, 0))
    if found.above:
        parts.append(f"above {number(found.highest_veh_h, 0)}{_seeds(found, found.above)}")
    if found.below:
        parts.append(f"at or below {number(found.lowest_veh_h, 0)}{_seeds(found, found.below)}")
    return "; ".join(parts)


def _seeds(found: Breakdown, number_of_seeds: int) -> str:
    everyone = len(found.flows) + found.above + found.below
    return "" if number_of_seeds == everyone else f" ({number_of_seeds} of {everyone} seeds)"
