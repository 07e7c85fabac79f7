"""Coordination of ramp meters, worked by hand and run against a store-and-forward ramp."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.strategies.alinea import Alinea
from coramp.strategies.hero import (
    Cluster,
    Coordination,
    Meter,
    balanced_queues_veh,
    filled_share,
)

RULE = Coordination()
CALM = Meter(10.0, 1200.0, 400.0, 0.0, 40.0)
FULL = Meter(20.0, 600.0, 900.0, 20.0, 40.0)
"""At its target; half of its room is taken, so that it is above 30 %."""
meters = st.lists(
    st.builds(
        Meter,
        st.floats(0.0, 60.0),
        st.floats(240.0, 1200.0),
        st.floats(0.0, 1500.0),
        st.floats(0.0, 60.0),
        st.floats(60.0, 100.0),
    ),
    min_size=1,
    max_size=6,
)


def test_alone_it_is_alinea():
    alinea = Alinea()
    for occupancy in (5.0, 18.0, 20.0, 26.0, 60.0):
        meter = Meter(occupancy, 600.0, 0.0, 0.0, 1000.0)
        (rate,) = RULE.rates_veh_h((), [meter])
        assert rate == alinea.next_rate_veh_h(600.0, occupancy)


def test_a_full_ramp_becomes_a_master_and_takes_in_the_next_one_upstream():
    assert RULE.clusters((), [CALM, CALM, FULL]) == (Cluster(2, (1,)),)
    # 20 of 80 are 25 %: no third ramp is needed yet.
    assert RULE.clusters((Cluster(2, (1,)),), [CALM, CALM, FULL]) == (Cluster(2, (1,)),)
    helper = CALM._replace(queue_veh=10.0)
    assert RULE.clusters((Cluster(2, (1,)),), [CALM, helper, FULL]) == (Cluster(2, (1, 0)),)


def test_the_most_upstream_master_has_nobody_to_ask():
    assert RULE.clusters((), [FULL, CALM]) == (Cluster(0),)


def test_two_masters_do_not_share_a_slave():
    assert RULE.clusters((), [CALM, FULL, FULL]) == (Cluster(2), Cluster(1, (0,)))


@pytest.mark.parametrize("change", [{"occupancy_percent": 15.9}, {"queue_veh": 5.9}])
def test_a_master_stops_where_its_mainline_or_its_ramp_is_free(change):
    assert RULE.clusters((Cluster(1, (0,)),), [CALM, FULL._replace(**change)]) == ()


@pytest.mark.parametrize("change", [{"occupancy_percent": 16.1}, {"queue_veh": 6.1}])
def test_it_goes_on_between_the_two_thresholds(change):
    meter = FULL._replace(**change)
    assert RULE.clusters((Cluster(1, (0,)),), [CALM, meter]) == (Cluster(1, (0,)),)
    if "queue_veh" in change:
        assert RULE.clusters((), [CALM, meter]) == ()


def test_a_slave_holds_back_what_its_share_asks():
    """20 + 0 wait in 40 + 60: 20 %, so that the slave is to have 12 in 30 s.

    400 arrive an hour; to be 12 more it would have to let 400 - 1440 pass: it lets the least pass.
    """
    slave = CALM._replace(room_veh=60.0)
    assert balanced_queues_veh([slave, FULL]) == pytest.approx([12.0, 8.0])
    assert RULE.towards_veh_h(slave, 12.0) == pytest.approx(400.0 - 1440.0)
    rates = RULE.rates_veh_h((Cluster(1, (0,)),), [slave, FULL])
    assert rates == pytest.approx([240.0, 600.0])
    near = slave._replace(queue_veh=11.0)  # 31 wait: 18.6 here; 400 - 7.6 * 120 is below the least
    assert RULE.rates_veh_h((Cluster(1, (0,)),), [near, FULL])[0] == pytest.approx(240.0)
    longer = Coordination(update_s=240.0)  # 400 - 7.6 * 15
    assert longer.rates_veh_h((Cluster(1, (0,)),), [near, FULL])[0] == pytest.approx(286.0)


def test_no_queue_grows_out_of_its_room():
    crowded = Meter(40.0, 300.0, 900.0, 40.0, 40.0)
    assert RULE.rates_veh_h((), [crowded]) == pytest.approx([900.0])
    assert RULE.rates_veh_h((Cluster(1, (0,)),), [crowded, crowded])[0] == pytest.approx(900.0)


def test_ramps_fill_up_alike():
    """The master's mainline stays at its target; nobody upstream would meter by itself."""
    rule, rooms = Coordination(), (50.0, 30.0, 40.0)
    state = [CALM._replace(room_veh=room, arrivals_veh_h=500.0) for room in rooms]
    state[2] = state[2]._replace(occupancy_percent=20.0, rate_veh_h=500.0, arrivals_veh_h=560.0)
    clusters: tuple[Cluster, ...] = ()
    for _ in range(90):
        clusters = rule.clusters(clusters, state)
        rates = rule.rates_veh_h(clusters, state)
        state = [
            m._replace(
                rate_veh_h=rate,
                queue_veh=max(0.0, m.queue_veh + (m.arrivals_veh_h - rate) * 30.0 / 3600.0),
            )
            for m, rate in zip(state, rates, strict=True)
        ]
    assert clusters == (Cluster(2, (1, 0)),)
    shares = [meter.share for meter in state]
    assert min(shares) > 0.25
    assert max(shares) - min(shares) < 0.02


@given(meters)
def test_balanced_queues_are_as_many_and_fit(found):
    queues = balanced_queues_veh(found)
    assert sum(queues) == pytest.approx(sum(m.queue_veh for m in found))
    for queue, meter in zip(queues, found, strict=True):
        assert queue <= meter.room_veh * (1.0 + 1e-9)
        assert queue / meter.room_veh == pytest.approx(filled_share(found))


@given(meters, st.integers(1, 8))
def test_clusters_are_of_neighbours_and_rates_within_bounds(found, updates):
    clusters: tuple[Cluster, ...] = ()
    for _ in range(updates):
        clusters = RULE.clusters(clusters, found)
    places = [place for cluster in clusters for place in cluster.members]
    assert len(places) == len(set(places))
    for cluster in clusters:
        members = cluster.members
        assert members == tuple(range(members[0], cluster.master + 1))
    for rate in RULE.rates_veh_h(clusters, found):
        assert RULE.least_veh_h <= rate <= RULE.most_veh_h
