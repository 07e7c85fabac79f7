"""The tables of a corridor's run: by site, by vehicle, by passage and hand-over, and its totals."""

from collections.abc import Mapping

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.metrics.frames import frame_of
from coramp.records.corridor_outcome import (
    HAND_OVERS,
    MESSAGES,
    METERS,
    PASSAGES,
    SITES,
    TOTALS,
    TRIPS,
    CorridorOutcome,
)
from coramp.records.schemas import Row
from coramp.road.streams import STREAMS

EVENTS = ("leaves", "enters")


def corridor_tables(outcome: CorridorOutcome) -> dict[str, pl.DataFrame]:
    """Returns the tables by the names of their files; that of meters only where there are some."""
    found = {
        "sites": _sites(outcome),
        "trips": _trips(outcome),
        "passages": _passages(outcome),
        "hand_overs": _hand_overs(outcome),
    }
    if outcome.meters is not None:
        found["meters"] = frame_of(METERS, **outcome.meters)
    return found


def totals_of(outcome: CorridorOutcome, sites: pl.DataFrame) -> Row:
    """Returns what the run of a corridor amounts to.

    The time spent is that of all vehicles, waiting to enter included, up to the end of the run.
    The delay is what they wait and what they lose against their wish.
    """
    trips = outcome.trips
    waiting_s, driven_s, lost_s = (
        _sum(trips[name]) for name in ("waiting_s", "driven_s", "lost_s")
    )
    vehicles, through = len(outcome.vehicle_id), int((~np.isnan(trips["left_s"])).sum())
    errors_m = outcome.plan_error_m[~np.isnan(outcome.plan_error_m)]
    found: Row = {
        "vehicles": vehicles,
        "through": through,
        "unserved": vehicles - through,
        "time_spent_s": waiting_s + driven_s,
        "waiting_s": waiting_s,
        "delay_s": waiting_s + lost_s,
        "mean_delay_s": (waiting_s + lost_s) / vehicles if vehicles else None,
        "vehicle_km": _sum(trips["way_m"]) / 1000.0,
        **{
            name: int(sites[name].sum())
            for name in ("merges", "made_way", "hard_brakings_3", "stopped_vehicles")
        },
        "hand_overs": len(outcome.hand_overs["time_s"]),
        "collisions": len({pair[1:] for pair in outcome.collided}),
        "collisions_by_automated": sum(
            bool(outcome.automated[rear]) for rear, _ in {pair[1:] for pair in outcome.collided}
        ),
        "plan_error_m": float(errors_m.max()) if len(errors_m) else None,
        "until_s": outcome.until_s,
        "most_at_once": outcome.most_at_once,
    }
    return {name: found[name] for name in TOTALS}


def _sum(values: FloatArray) -> float:
    return float(np.nansum(values))


def _delay_s(outcome: CorridorOutcome) -> FloatArray:
    """Of each passage, beyond the time that it takes to drive freely."""
    passages = outcome.passages
    return np.asarray(passages["left_s"] - passages["entered_s"] - outcome.free_s)


def _sites(outcome: CorridorOutcome) -> pl.DataFrame:
    corridor = outcome.corridor
    roads = [(k, road) for k, road in enumerate(corridor.roads, 1) for _ in road.sites]
    rows = []
    for k, (site, zone) in enumerate(zip(corridor.sites, corridor.zones, strict=True)):
        road, whole = roads[k]
        messages: Mapping[str, int] = outcome.messages[k] if outcome.messages else {}
        rows.append(
            {
                "site": site.ramp_id,
                "road": road,
                "nose_m": whole.nose_m(site),
                "zone_m": zone.to_m - zone.from_m,
                **_figures(outcome, k),
                **{name: messages.get(name) for name in MESSAGES},
            }
        )
    return frame_of(SITES, **{name: [row[name] for row in rows] for name in SITES})


def _figures(outcome: CorridorOutcome, site: int) -> Row:
    """What passed in the zone of one site; delays are means of those who have left it."""
    passages = outcome.passages
    own = passages["site"] == site
    number = passages["number"][own].astype(np.int64)
    ramp, left = passages["on_ramp"][own] > 0.0, ~np.isnan(passages["left_s"][own])
    delay_s = _delay_s(outcome)[own]
    events = outcome.hand_overs["enters"][outcome.hand_overs["site"] == site]
    return {
        "mainline_vehicles": int((~ramp).sum()),
        "ramp_vehicles": int(ramp.sum()),
        "automated_vehicles": int(outcome.automated[number].sum()),
        "mainline_served": int((left & ~ramp).sum()),
        "ramp_served": int((left & ramp).sum()),
        "mainline_delay_s": _mean(delay_s[left & ~ramp]),
        "ramp_delay_s": _mean(delay_s[left & ramp]),
        "merges": int((~np.isnan(passages["merged_s"][own])).sum()),
        "made_way": int(passages["changes"][own].sum()),
        "hard_brakings_3": int(passages["hard_brakings"][own].sum()),
        "stopped_vehicles": int(passages["stopped"][own].sum()),
        "taken_over": int((events > 0.0).sum()),
        "handed_on": int((events == 0.0).sum()),
    }


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) else None


def _trips(outcome: CorridorOutcome) -> pl.DataFrame:
    trips = outcome.trips
    return frame_of(
        TRIPS,
        vehicle_id=outcome.vehicle_id,
        origin=outcome.origin,
        leaves_by=outcome.leaves_by,
        automated=outcome.automated,
        scheduled_s=outcome.scheduled_s,
        delay_s=trips["waiting_s"] + np.nan_to_num(trips["lost_s"]),
        **{name: trips[name] for name in ("entered_s", "left_s", "waiting_s", "driven_s", "way_m")},
    )


def _named(outcome: CorridorOutcome, rows: Mapping[str, FloatArray]) -> dict[str, list[str]]:
    sites = [site.ramp_id for site in outcome.corridor.sites]
    return {
        "vehicle_id": [outcome.vehicle_id[int(n)] for n in rows["number"]],
        "site": [sites[int(k)] for k in rows["site"]],
    }


def _passages(outcome: CorridorOutcome) -> pl.DataFrame:
    rows = outcome.passages
    frame = frame_of(
        PASSAGES,
        **_named(outcome, rows),
        stream=[STREAMS[int(on_ramp)] for on_ramp in rows["on_ramp"]],
        entered_s=rows["entered_s"],
        merged_s=rows["merged_s"],
        left_s=rows["left_s"],
        delay_s=_delay_s(outcome),
        hard_brakings_3=rows["hard_brakings"].astype(np.int64),
        stopped=rows["stopped"] > 0.0,
        made_way=rows["changes"].astype(np.int64),
    )
    return frame.sort("entered_s", "vehicle_id", maintain_order=True)


def _hand_overs(outcome: CorridorOutcome) -> pl.DataFrame:
    rows = outcome.hand_overs
    lane = [None if np.isnan(own) else int(own) for own in rows["lane"]]
    return frame_of(
        HAND_OVERS,
        time_s=rows["time_s"],
        **_named(outcome, rows),
        event=[EVENTS[int(enters)] for enters in rows["enters"]],
        station_m=rows["station_m"],
        lane=lane,
        speed_mps=rows["speed_mps"],
    )
