"""The tables of what coordination is worth, and the lane's own breakdown."""

import polars as pl
import pytest

from coramp.scenarios.loading import load_scenario
from coramp.studies.breakdown import BREAKDOWN_DELAY_S
from coramp.studies.capacity_layout import capacity_tables
from coramp.studies.lane_breakdown import lane_flows_veh_h, least_delay_s, mean_bound_s
from coramp.studies.worth_layout import name_of, worth_tables
from tests.study import settings_of

FIGURES = {
    "mainline_delay_s": 1.0,
    "ramp_delay_s": 2.0,
    "fuel_l": 30.0,
    "hard_brakings_3": 2,
    "hard_brakings_4_5": 1,
    "stops": 3,
    "min_ttc_s": 4.0,
    "collisions": 0,
    "unserved": 0,
}


def run(strategy, drivers, overrides, delay_s, mainline=1200.0, **figures):
    return {
        "scenario": "paper",
        "strategy": strategy,
        "drivers": drivers,
        "overrides": overrides,
        "settings": settings_of(overrides),
        "mainline_veh_h": mainline,
        "ramp_veh_h": 300.0,
        "delay_s": delay_s,
        **FIGURES,
        **figures,
    }


RUNS = [
    run("slots", None, "safety.standstill_gap_m=2.5 safety.time_gap_s=1.0", 1.0),
    run("slots", None, "safety.standstill_gap_m=2.5 safety.time_gap_s=1.0", 2.0),
    run("slots", None, None, 0.2),
    run("uncontrolled", "fair", "drivers.fair.tau_s=1.4", 5.0, unserved=4, collisions=1),
    run("uncontrolled", "fair", None, 9.0, mainline=1800.0),
]


def test_everyone_is_named_by_who_and_which_gaps():
    assert [name_of(r) for r in RUNS[1:]] == [
        "slots, 1.0 s, 2.5 m",
        "slots, Eq. 1",
        "fair drivers, tau_s=1.4",
        "fair drivers",
    ]


def test_a_scenario_s_own_gaps_are_named_too():
    own = {**run("slots", None, None, 1.0), "scenario": "motorway"}
    assert name_of(own) == "slots, 1.0 s, 2.5 m"
    longer = {**run("slots", None, "safety.time_gap_s=1.4", 1.0), "scenario": "motorway"}
    assert name_of(longer) == "slots, 1.4 s, 2.5 m"


def test_delays_stand_by_flow_and_the_rest_once_a_flow():
    delays, low, high = worth_tables(pl.DataFrame(RUNS))
    assert delays.columns == ("vehicles, gaps", "1200 + 300", "1800 + 300")
    cells = {row[0]: row[1:] for row in delays.rows}
    assert list(cells)[:2] == ["slots, Eq. 1", "slots, 1.0 s, 2.5 m"]
    # 1 and 2 s: the mean 1.5 and, with one degree of freedom, 12.706 * 0.5
    assert cells["slots, 1.0 s, 2.5 m"] == ("1.50 ± 6.35", "-")
    assert cells["fair drivers, tau_s=1.4"] == ("5.00 (u 4, c 1)", "-")
    assert cells["fair drivers"] == ("-", "9.00")
    figures = {row[0]: row[1:] for row in low.rows}
    # sums over the two seeds but for delays, fuel and the smallest TTC
    assert figures["slots, 1.0 s, 2.5 m"][3:6] == ("4, 2", "6", "4.00")
    assert [row[0] for row in high.rows] == ["fair drivers"]


def test_no_runs_give_no_tables():
    assert worth_tables(pl.DataFrame()) == []


def searched(strategy, flows, broken_from, overrides="safety.time_gap_s=1.4", seed=1):
    return [
        {
            "scenario": "paper",
            "strategy": strategy,
            "drivers": None,
            "overrides": overrides,
            "settings": settings_of(overrides),
            "ramp_veh_h": 500.0,
            "seed": seed,
            "mainline_veh_h": flow,
            "mainline_delay_s": 9.0 if flow >= broken_from else 1.0,
            "ramp_delay_s": 1.0,
            "unserved": 0,
            "lane_limit_veh_h": 2172.6,
        }
        for flow in flows
    ]


def test_the_lane_breaks_down_where_its_least_delay_passes_the_limit():
    good = pl.DataFrame(searched("slots", [800.0, 1400.0, 1500.0, 2400.0], 1500.0))
    found = lane_flows_veh_h(good, 600.0)
    flow = found["paper", "safety.time_gap_s=1.4", 500.0, 1]
    setting = ("paper", settings_of("safety.time_gap_s=1.4"), 600.0, 500.0, 1)
    assert least_delay_s(*setting, flow) > BREAKDOWN_DELAY_S >= least_delay_s(*setting, flow - 100)
    rows = {row[0]: row[1:] for row in capacity_tables(good, 600.0)[1].rows}
    assert rows["the bound, 1.4 s"] == (f"{flow:.0f}",)
    share = f"{100 * 1500 / flow:.0f} % (92 %)"  # 1500 + 500 of 2172.6
    assert rows["slots, 1.4 s"] == (share,)


def test_the_least_delay_by_hand():
    # two mainline vehicles at 20 m/s, 1 s apart, h = 1.257 s: the second is 0.257 s late
    scenario = load_scenario(
        "paper",
        {
            "safety.time_gap_s": 1.0,
            "arrivals": [
                {"stream": "mainline", "time_s": 1.0, "speed_mps": 20.0},
                {"stream": "mainline", "time_s": 2.0, "speed_mps": 20.0},
            ],
        },
    )
    assert mean_bound_s(scenario, 1) == pytest.approx(0.257 / 2.0, abs=1e-6)
