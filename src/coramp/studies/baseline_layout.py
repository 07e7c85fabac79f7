"""What a gain owes to its baseline, and what to short gaps rather than to coordination."""

from typing import Any

import polars as pl

from coramp.loading import load_scenario
from coramp.scenario import Drivers
from coramp.studies.paper_layout import LEAST_BASELINE_S, percent, rate
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import Table, with_interval

LANE = "ramp.acceleration_lane_m"
GAP = "safety.time_gap_s"
CONTROLLED = "mainline-priority"
FLOW = ["mainline_veh_h", "ramp_veh_h"]
MARKED = "u: vehicles that were not out at the end; c: collisions that SUMO saw; over all seeds."


def baseline_tables(good: pl.DataFrame) -> list[Table]:
    """Returns the rate of improvement against each baseline, and delays at equal time gaps."""
    if good.is_empty():
        return []
    runs = good.with_columns(
        settings=pl.Series(
            [settings_of(run) for run in good.iter_rows(named=True)], dtype=pl.Object
        )
    )
    return [*_rates(runs), *_gaps(runs)]


def settings_of(run: dict[str, Any]) -> dict[str, Any]:
    """Returns what a run's overrides say, and the scenario's own values for the rest."""
    scenario = load_scenario(run["scenario"])
    found: dict[str, Any] = {
        LANE: scenario.ramp.acceleration_lane_m,
        GAP: scenario.safety.time_gap_s,
    }
    if run["drivers"] is not None:
        found.update(scenario.drivers[run["drivers"]].model_dump())
    for part in (run["overrides"] or "").split():
        key, _, text = part.partition("=")
        found[key.removeprefix(f"drivers.{run['drivers']}.")] = _value(text)
    return found


def _value(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _estimates(runs: pl.DataFrame, column: str) -> dict[tuple[float, float], Estimate]:
    return {
        (float(key[0]), float(key[1])): estimate(group[column].drop_nulls().to_list())
        for key, group in runs.group_by(FLOW, maintain_order=True)
    }


def _matching(runs: pl.DataFrame, **wanted: Any) -> pl.DataFrame:
    keys = {"lane": LANE, "gap": GAP}
    kept = [
        all(settings.get(keys.get(k, k)) == v for k, v in wanted.items())
        for settings in runs["settings"].to_list()
    ]
    return runs.filter(pl.Series(kept, dtype=pl.Boolean))


def _rates(runs: pl.DataFrame) -> list[Table]:
    drivers = _matching(runs.filter(strategy="uncontrolled"), car_following="Krauss")
    flows = sorted(drivers.select(FLOW).unique().iter_rows())
    rows = []
    for text in drivers["overrides"].fill_null("").unique(maintain_order=True):
        for population in ("paper", "fair"):
            own = drivers.filter(pl.col("overrides").fill_null("") == text, drivers=population)
            if own.is_empty():
                continue
            said = own["settings"][0]
            controlled = _matching(runs.filter(strategy=CONTROLLED), lane=said[LANE], gap=0.0)
            rows.append((said, _rate_row(population, said, own, controlled, flows)))
    rows.sort(key=lambda row: (row[1][0], row[0][LANE], row[1]))
    if not rows:
        return []
    columns = ("drivers", "lane (m)", "integrator", "sigma", "lcCooperative")
    per_flow = (f"{m:g} + {r:g}: {what}" for m, r in flows for what in ("D_k (s)", "I_r (%)"))
    notes = (
        (
            "D_k: mean mainline delay of the drivers, with its 95 % interval; I_r: Eq. 46 for "
            f"{CONTROLLED} on the same lane. A dash where the drivers lose less than "
            f"{LEAST_BASELINE_S:g} s."
        ),
        MARKED,
    )
    table_rows = tuple(row for _, row in rows)
    return [Table("Improvement against each baseline", (*columns, *per_flow), table_rows, notes)]


def _rate_row(
    population: str,
    said: dict[str, Any],
    own: pl.DataFrame,
    controlled: pl.DataFrame,
    flows: list[tuple[float, float]],
) -> tuple[str, ...]:
    drivers, ours = _estimates(own, "mainline_delay_s"), _estimates(controlled, "mainline_delay_s")
    cells = [population, f"{said[LANE]:g}", str(said["integrator"]), f"{said['sigma']:g}"]
    cells.append(f"{said['lc_cooperative']:g}")
    for flow in flows:
        nothing = estimate([])
        baseline, plan = drivers.get(flow, nothing), ours.get(flow, nothing)
        cells.append(with_interval(baseline) + _marks(own, flow))
        cells.append(percent(rate(plan.mean, baseline.mean, LEAST_BASELINE_S)))
    return tuple(cells)


def _gaps(runs: pl.DataFrame) -> list[Table]:
    followers = runs.filter(strategy="uncontrolled")
    flows = sorted(
        {
            flow
            for model in ("ACC", "CACC")
            for flow in _matching(followers, car_following=model).select(FLOW).iter_rows()
        }
    )
    rows: list[tuple[str, ...]] = []
    lane = Drivers(wish="free-flow")
    for gap in sorted({s[GAP] for s in runs["settings"].to_list()}):
        cases = [
            (f"uncoordinated {m}", _matching(followers, car_following=m, tau_s=gap))
            for m in ("ACC", "CACC")
        ]
        cases += [
            (f"coordinated, {name}", _at_own_lane(runs.filter(strategy=name), gap))
            for name in (CONTROLLED, "ramp-priority")
        ]
        cases.append((f"Krauss, sigma {lane.sigma:g}", _default_drivers(followers, gap)))
        for name, own in cases:
            if not own.is_empty():
                rows.append((f"{gap:g}" if gap else "Eq. 1", name, *_delays(own, flows)))
    if not rows or not flows:
        return []
    columns = ("time gap (s)", "vehicles", *(f"{m:g} + {r:g}" for m, r in flows))
    note = "Mean delay of mainline / ramp in s, with 95 % intervals over seeds."
    notes = (note, MARKED)
    return [Table("The same time gaps without and with a plan", columns, tuple(rows), notes)]


def _at_own_lane(runs: pl.DataFrame, gap: float) -> pl.DataFrame:
    found = _matching(runs, gap=gap)
    if found.is_empty():
        return found
    return _matching(found, lane=load_scenario(found["scenario"][0]).ramp.acceleration_lane_m)


def _default_drivers(followers: pl.DataFrame, gap: float) -> pl.DataFrame:
    found = _matching(followers, car_following="Krauss", tau_s=gap)
    return found.filter(pl.col("overrides").is_null(), pl.col("drivers") == "fair")


def _delays(own: pl.DataFrame, flows: list[tuple[float, float]]) -> list[str]:
    mainline, ramp = _estimates(own, "mainline_delay_s"), _estimates(own, "ramp_delay_s")
    cells = []
    for flow in flows:
        if flow not in mainline:
            cells.append("-")
            continue
        text = f"{with_interval(mainline[flow])} / {with_interval(ramp[flow])}"
        cells.append(text + _marks(own, flow))
    return cells


def _marks(own: pl.DataFrame, flow: tuple[float, float]) -> str:
    """What a delay must not be read without: who was not out at the end, and who collided."""
    there = own.filter(mainline_veh_h=flow[0], ramp_veh_h=flow[1])
    counts = (("u", there["unserved"].sum()), ("c", there["collisions"].sum()))
    return "".join(f", {mark} {count}" for mark, count in counts if count)
