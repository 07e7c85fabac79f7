"""Slots: known answers, the bound, orders, queues, any gaps and roads."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.coordination.plant import Arrival
from coramp.errors import CorampError
from coramp.kinematics.trajectory import cruise_intercept_m
from coramp.metrics.tables import tables_of
from coramp.scenarios.loading import load_scenario
from coramp.strategies.base import EntryPolicy
from coramp.strategies.slots import Slots
from coramp.worlds.exact.engine import run_exact
from tests.situations import driven, least_margin_m, loop, named, traffic

HEADWAY_S = 1.257
"""1 s, and 5 m, 0.04 m of Eq. 1 and 0.1 m of the allowance at 20 m/s."""


def paper(time_gap_s=1.0, **settings_of):
    return load_scenario(
        "paper",
        {
            "safety.time_gap_s": time_gap_s,
            **{key.replace("__", "."): value for key, value in settings_of.items()},
        },
    )


def crossings(scenario, arrivals, **parameters):
    """When each arrival would cross the nose at v0 (s), by its place among the arrivals."""
    coordinator = loop(scenario, arrivals, Slots(**parameters))
    v0 = scenario.mainline.speed_mps
    result = np.full(len(arrivals), np.nan)
    for row, arrival in enumerate(coordinator.entered()[0]):
        result[arrival] = -cruise_intercept_m(coordinator.ledger.trajectory(row), v0) / v0
    return result


def mainline(*steps, speed_mps=20.0, length_m=5.0):
    return [Arrival("", False, step, speed_mps, length_m) for step in steps]


def ramp(*steps, speed_mps=16.0, length_m=5.0):
    return [Arrival("", True, step, speed_mps, length_m) for step in steps]


# A mainline vehicle at 20 m/s crosses 20 s after its entry. A ramp vehicle at 16 m/s passes the
# nose after 25 s and loses 4 m behind it, 0.2 s: it crosses 25.2 s after its entry.


def test_alone_everyone_crosses_as_in_free_movement():
    seen = crossings(paper(), named(mainline(0) + ramp(200)))
    assert seen == pytest.approx([20.0, 45.2])


def test_two_vehicles_one_slot():
    # both would cross at 25.2 s; who has just entered the mainline is planned first
    seen = crossings(paper(), named(mainline(52) + ramp(0)))
    assert seen == pytest.approx([25.2 + HEADWAY_S, 25.2])


def test_a_ramp_vehicle_that_comes_first_goes_first():
    seen = crossings(paper(), named(mainline(55) + ramp(0)))
    assert seen == pytest.approx([25.2, 25.2 + HEADWAY_S], abs=0.02)


def test_a_platoon_and_a_ramp_vehicle():
    # mainline vehicles every 1.3 s from 16 s on; free, they would cross from 36 s on. The ramp
    # vehicle would cross at 38 s: behind the second of them (37.3 s), so at 37.3 + h. The third
    # and those behind it each come h later than the one before, until 1.3 s a vehicle make up.
    arrivals = named(mainline(*range(160, 290, 13)) + ramp(128))
    on_ramp = [a.on_ramp for a in arrivals]
    seen = crossings(paper(), arrivals)
    expected, last = [], -1.0
    for free in sorted([36.0 + 1.3 * k for k in range(10)] + [38.0]):
        last = max(free, last + HEADWAY_S)
        expected.append(last)
    assert np.sort(seen) == pytest.approx(expected, abs=0.06)
    assert seen[on_ramp.index(True)] == pytest.approx(37.3 + HEADWAY_S)


@pytest.mark.parametrize(
    ("time_gap_s", "flows", "seed"),
    [(0.6, (2000.0, 700.0), 401), (1.0, (1700.0, 600.0), 402), (1.4, (1200.0, 450.0), 403)],
)
def test_random_arrivals_lose_hardly_more_than_the_lane_asks(time_gap_s, flows, seed):
    scenario = paper(
        time_gap_s,
        mainline__flow_veh_h=flows[0],
        ramp__flow_veh_h=flows[1],
        simulation__horizon_s=900.0,
    )
    tables = tables_of(run_exact(scenario, Slots(), seed), scenario)
    assert tables.metrics["unserved"] == 0
    assert tables.metrics["safety_violations"] == 0
    assert 1.0 - 1e-6 <= tables.metrics["delay_bound_ratio"] <= 1.10


OVERLOADED = {
    "mainline__flow_veh_h": 2300.0,
    "ramp__flow_veh_h": 800.0,
    "simulation__horizon_s": 400.0,
}


def overloaded(**parameters):
    scenario = paper(1.4, **OVERLOADED)
    tables = tables_of(run_exact(scenario, Slots(**parameters), 11), scenario)
    assert tables.metrics["unserved"] == 0
    assert tables.metrics["safety_violations"] == 0
    return tables


def test_beyond_the_limit_the_lane_never_idles_and_both_streams_wait_alike():
    tables = overloaded()
    assert tables.metrics["delay_s"] > 40.0
    assert tables.metrics["delay_bound_ratio"] <= 1.05
    streams = {figures["stream"]: figures["delay_s"] for figures in tables.streams}
    assert streams["ramp"] == pytest.approx(streams["mainline"], rel=0.15)


def test_the_share_moves_the_queue_from_one_stream_to_the_other():
    by_share = {share: overloaded(ramp_share=share).streams for share in (0.2, 0.5, 0.8)}
    ramp_s = [by_share[share][1]["delay_s"] for share in (0.2, 0.5, 0.8)]
    mainline_s = [by_share[share][0]["delay_s"] for share in (0.2, 0.5, 0.8)]
    assert ramp_s[0] > 1.2 * ramp_s[1] > 1.2 * 1.2 * ramp_s[2]
    assert mainline_s[0] < mainline_s[1] < mainline_s[2]


def test_nobody_waits_for_ever_where_the_mainline_comes_first():
    patient = overloaded(order="mainline-first", longest_wait_s=3600.0).vehicles
    served = overloaded(order="mainline-first", longest_wait_s=20.0).vehicles
    longest_s = {
        name: vehicles.filter(stream="ramp")["delay_s"].max()
        for name, vehicles in (("patient", patient), ("served", served))
    }
    assert longest_s["served"] < longest_s["patient"]


def test_orders_say_who_waits():
    scenario = paper(
        1.0,
        mainline__flow_veh_h=1800.0,
        ramp__flow_veh_h=500.0,
        simulation__horizon_s=600.0,
    )
    seen = {
        order: tables_of(run_exact(scenario, Slots(order=order), 21), scenario).metrics
        for order in ("first-come", "mainline-first", "ramp-first", "least-delay")
    }
    first = seen["first-come"]
    assert seen["mainline-first"]["mainline_delay_s"] < first["mainline_delay_s"]
    assert seen["mainline-first"]["ramp_delay_s"] > first["ramp_delay_s"]
    assert seen["ramp-first"]["ramp_delay_s"] < first["ramp_delay_s"]
    assert seen["ramp-first"]["mainline_delay_s"] > first["mainline_delay_s"]
    for key in ("mainline_delay_s", "ramp_delay_s"):
        assert seen["least-delay"][key] == first[key]


def test_least_delay_lets_the_shorter_of_two_that_wait_go_first():
    # long vehicles keep the mainline waiting at the entrance when the short ramp vehicle comes
    arrivals = named(mainline(*range(0, 200, 10), length_m=12.0) + ramp(90, 105, 120))
    on_ramp = np.array([a.on_ramp for a in arrivals])
    first = crossings(paper(), arrivals)
    least = crossings(paper(), arrivals, order="least-delay")
    assert least[on_ramp].mean() < first[on_ramp].mean()


def test_a_smooth_way_has_less_jerk_where_lags_are_small():
    scenario = paper(
        1.0,
        mainline__flow_veh_h=1200.0,
        ramp__flow_veh_h=300.0,
        simulation__horizon_s=600.0,
    )
    plain, smooth = (
        run_exact(scenario, Slots(smooth=smooth, clear_entrance=False), 5)
        for smooth in (False, True)
    )

    def effort(outcome):
        rows, first = outcome.pieces.rows, outcome.pieces.first
        same = np.ones(len(rows) - 1, bool)
        same[first[1:-1] - 1] = False
        return float((rows[:-1, 3] ** 2 * np.diff(rows[:, 0]))[same].sum())

    assert effort(smooth) < 0.95 * effort(plain)


def test_a_share_without_an_order_that_it_is_for_is_refused():
    with pytest.raises(CorampError, match=r"strategy.slots.ramp_share: 0.2 says nothing"):
        paper(1.0, strategy__slots__order="ramp-first", strategy__slots__ramp_share=0.2)
    with pytest.raises(CorampError, match=r"strategy.slots.order: 'last' cannot be; allowed is"):
        paper(1.0, strategy__slots__order="last")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_parameter_that_is_not_finite_is_refused_in_one_line(value):
    with pytest.raises(CorampError) as refused:
        paper(1.0, strategy__slots__ramp_share=value)
    (line,) = refused.value.messages
    assert line.endswith(
        f"strategy.slots.ramp_share: {value} cannot be; allowed are finite numbers"
    )


class Undeclared(Slots):
    """Slots that do not say that they may hold up newcomers."""

    name = "undeclared"
    entry_policy = EntryPolicy(asked=True, holds_newcomers=False)


def test_who_may_hold_up_newcomers_must_say_so():
    arrivals = named(mainline(56) + ramp(0))
    declared = loop(paper(), arrivals, Slots())
    assert declared.refusals == []
    undeclared = loop(paper(), arrivals, Undeclared(order="ramp-first"))
    reasons = {refusal.reason for refusal in undeclared.refusals}
    assert reasons == {
        "may hold up a mainline vehicle that is yet to enter, which its strategy does not declare"
    }


def test_newcomers_wait_outside_until_they_can_enter_safely():
    # ten ramp vehicles get ten slots in a row before the mainline's vehicles come
    arrivals = named(ramp(*range(0, 200, 20)) + mainline(*range(60, 200, 8)))
    scenario = paper()
    coordinator = loop(scenario, arrivals, Slots(order="ramp-first"))
    assert coordinator.waiting() == []
    assert coordinator.refusals == []
    who, step = coordinator.entered()
    assert any(step[k] > arrivals[who[k]].step for k in range(len(who)))
    least_m = least_margin_m(driven(coordinator, arrivals), scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6


class Listener(Slots):
    """Slots that note what they are told of entries and of who waits."""

    name = "listener"

    def decide(self, view, memory):
        self.told.append((view.time_s, view.entered, view.waiting))
        return super().decide(view, memory)


def test_a_strategy_is_told_who_has_entered_and_who_waits():
    arrivals = named(mainline(0, 6, 12, 18) + ramp(7))
    listener = Listener()
    object.__setattr__(listener, "told", [])
    coordinator = loop(paper(), arrivals, listener)
    entered = [e for _, some, _ in listener.told for e in some]
    assert sorted(e.row for e in entered) == list(range(5))
    who, step = coordinator.entered()
    for e in entered:
        assert e.time_s == pytest.approx(step[e.row] * 0.1)
        assert e.since_s == pytest.approx(arrivals[who[e.row]].step * 0.1)
        assert e.on_ramp == arrivals[who[e.row]].on_ramp
    for time_s, _, waiting in listener.told:
        came = [a for a in arrivals if a.step * 0.1 <= time_s + 1e-9]
        inside = [k for k in range(5) if step[k] * 0.1 <= time_s + 1e-9]
        assert len(waiting.vehicle) == len(came) - len(inside)
        assert (waiting.since_s <= time_s + 1e-9).all()
    assert any(len(waiting.vehicle) for _, _, waiting in listener.told)


@st.composite
def roads(draw):
    """Any gaps on any road; what does not fit together is drawn again."""
    speed_mps = draw(st.sampled_from([16.0, 20.0, 27.0]))
    ramp_mps = speed_mps * draw(st.sampled_from([0.6, 0.8, 0.9]))
    chosen = {
        "safety.time_gap_s": draw(st.floats(0.0, 2.0)),
        "safety.standstill_gap_m": draw(st.sampled_from([0.0, 1.0, 2.5])),
        "mainline.start_m": draw(st.sampled_from([-300.0, -500.0, -900.0])),
        "mainline.end_m": draw(st.sampled_from([320.0, 600.0])),
        "mainline.speed_mps": speed_mps,
        "mainline.limit_mps": speed_mps + draw(st.sampled_from([0.0, 2.0])),
        "mainline.entry_speed_mps": [0.7 * speed_mps, speed_mps],
        "ramp.start_m": draw(st.sampled_from([-300.0, -450.0, -900.0])),
        "ramp.speed_mps": ramp_mps,
        "ramp.limit_mps": ramp_mps + 1.0,
        "ramp.entry_speed_mps": [0.8 * ramp_mps, ramp_mps + 0.5],
        "ramp.acceleration_lane_m": draw(st.sampled_from([120.0, 200.0, 300.0])),
        "ramp.decision_station_m": draw(st.sampled_from([-150.0, -200.0, -250.0])),
        "control.actuation_delay_s": draw(st.sampled_from([0.0, 0.1, 0.4])),
    }
    try:
        return load_scenario("paper", chosen)
    except CorampError:
        return load_scenario("paper", {"safety.time_gap_s": chosen["safety.time_gap_s"]})


parameters = st.fixed_dictionaries(
    {
        "order": st.sampled_from(["first-come", "mainline-first", "ramp-first", "least-delay"]),
        "longest_wait_s": st.sampled_from([5.0, 300.0]),
        "clear_entrance": st.booleans(),
        "smooth": st.booleans(),
    }
)


@settings(max_examples=60)
@given(roads(), parameters, st.data())
def test_at_any_gaps_on_any_road_everyone_gets_through_safely(scenario, chosen, data):
    arrivals = data.draw(traffic(scenario))
    coordinator = loop(scenario, arrivals, Slots(**chosen), last_s=600.0)
    assert coordinator.refusals == []
    assert coordinator.waiting() == []
    assert all(coordinator.ledger.exit_time_s(k) < 600.0 for k in range(len(arrivals)))
    least_m = least_margin_m(driven(coordinator, arrivals, 600.0), scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6
