"""Messages, positions and clocks that fail: each fault is as large as is said, and alone."""

import zlib

import numpy as np
import pytest

from coramp.scenarios.world_sections import Clock, Link, Positioning
from coramp.worlds.faults.link import LossyLink
from coramp.worlds.faults.positions import WrongClocks, WrongPositions

COUNT = 200
STEP_S = 0.2
EVERYONE = np.arange(COUNT)


def random_of(fault):
    return np.random.default_rng([7, zlib.crc32(fault.encode())])


def sent_over(link, steps, numbers=EVERYONE):
    """Sends a row (number, time) of each vehicle at each step; returns rows and arrival times."""
    rows, arrived_s = [np.empty((0, 2))], []
    for step in range(steps):
        now_s = step * STEP_S
        link.send(now_s, np.column_stack([numbers.astype(float), np.full(len(numbers), now_s)]))
        rows.append(link.received(now_s))
        arrived_s += [now_s] * len(rows[-1])
    return np.concatenate(rows), np.array(arrived_s)


def link_of(**keys):
    return LossyLink(Link(**keys), COUNT, random_of)


def test_a_perfect_link_delivers_all_at_once_and_in_order():
    link = link_of()
    rows, arrived_s = sent_over(link, 5)
    assert len(rows) == 5 * COUNT == link.sent
    assert link.lost == 0
    assert np.array_equal(rows[:, 1], arrived_s)


@pytest.mark.parametrize("loss", [0.1, 0.3])
@pytest.mark.parametrize("burst_s", [None, 1.0])
def test_the_share_that_is_lost_is_the_loss(loss, burst_s):
    link = link_of(loss=loss, burst_s=burst_s)
    rows, _ = sent_over(link, 500)
    assert link.sent == 500 * COUNT
    assert len(rows) == link.sent - link.lost
    assert link.lost / link.sent == pytest.approx(loss, abs=0.02)


@pytest.mark.parametrize(("burst_s", "loss"), [(1.0, 0.3), (3.0, 0.2)])
def test_losses_come_in_bursts_of_the_mean_length(burst_s, loss):
    """Observed each 0.05 s: a chain of rates 1/b, p/(b(1-p)) stays bad with the chance below."""
    step_s = 0.05
    link = LossyLink(Link(loss=loss, burst_s=burst_s), COUNT, random_of)
    bad = []
    for step in range(4000):
        link.send(step * step_s, np.column_stack([EVERYONE.astype(float), np.zeros(COUNT)]))
        there = np.ones(COUNT, np.bool_)
        there[link.received(step * step_s)[:, 0].astype(int)] = False
        bad.append(there)
    bad = np.array(bad)
    begins = (bad[1:] & ~bad[:-1]).sum()
    rate = 1.0 / burst_s / (1.0 - loss)
    leaves = (1.0 - loss) * (1.0 - np.exp(-rate * step_s))
    assert bad[1:].sum() / begins * step_s == pytest.approx(step_s / leaves, rel=0.05)
    assert step_s / leaves == pytest.approx(burst_s, rel=0.06)


def test_each_vehicle_has_bursts_of_its_own():
    link = link_of(loss=0.5, burst_s=2.0)
    link.send(100.0, np.column_stack([EVERYONE.astype(float), np.zeros(COUNT)]))
    assert 0.3 * COUNT < link.lost < 0.7 * COUNT


@pytest.mark.parametrize("shape", [None, 2.0])
def test_latency_has_the_mean_that_is_said(shape):
    link = link_of(delay_s=0.5, delay_shape=shape)
    link.send(0.0, np.column_stack([np.tile(EVERYONE, 1).astype(float), np.zeros(COUNT)]))
    for step in range(1, 200):
        link.send(0.0, np.column_stack([EVERYONE.astype(float), np.full(COUNT, step)]))
    due_s = np.sort(link._due_s)
    assert due_s.mean() == pytest.approx(0.5, rel=0.02)
    expected = 0.0 if shape is None else 0.5 / np.sqrt(shape)
    assert due_s.std() == pytest.approx(expected, rel=0.03, abs=1e-9)
    early = link.received(0.25)
    assert len(early) == (due_s <= 0.25).sum()


def test_messages_with_a_drawn_latency_overtake_one_another():
    rows, _ = sent_over(link_of(delay_s=0.5, delay_shape=1.0), 50)
    own = rows[rows[:, 0] == 0.0][:, 1]
    assert (np.diff(own) < 0.0).any()


def test_messages_are_handed_over_in_the_order_in_which_they_arrived():
    """Read at once, after all have come: each message is due when another link hands it over."""
    one, other = (link_of(delay_s=0.5, delay_shape=1.0) for _ in range(2))
    for link in (one, other):
        for k in range(30):
            link.send(0.1 * k, np.array([[0.0, 0.1 * k]]))
    at_once = other.received(99.0)[:, 1].tolist()
    by_and_by = [row[1] for now_s in np.arange(0.0, 30.0, 0.001) for row in one.received(now_s)]
    assert at_once == by_and_by
    assert at_once != sorted(at_once)


def test_the_same_latency_for_all_keeps_the_order():
    rows, arrived_s = sent_over(link_of(delay_s=0.4), 50)
    assert np.allclose(arrived_s - rows[:, 1], 0.4)
    own = rows[rows[:, 0] == 0.0][:, 1]
    assert (np.diff(own) > 0.0).all()


def test_messages_come_twice_as_often_as_said():
    link = link_of(duplicates=0.25)
    rows, _ = sent_over(link, 200)
    assert len(rows) / link.sent == pytest.approx(1.25, abs=0.01)
    assert link.lost == 0


def test_a_message_that_is_lost_does_not_come_at_all():
    link = link_of(duplicates=1.0, loss=0.5)
    rows, _ = sent_over(link, 50)
    assert len(rows) == 2 * (link.sent - link.lost)


def lost_of(number, others, **keys):
    """At which sendings a vehicle's message is lost, with these others on the road."""
    link = link_of(**keys)
    rows, _ = sent_over(link, 100, np.array([number, *others]))
    return set(rows[rows[:, 0] == number][:, 1].tolist())


@pytest.mark.parametrize("burst_s", [None, 1.0])
def test_who_else_is_on_the_road_does_not_change_a_vehicles_losses(burst_s):
    keys = {"loss": 0.3, "burst_s": burst_s}
    assert lost_of(5, [], **keys) == lost_of(5, [1, 9, 77], **keys)


def test_one_fault_of_a_link_leaves_the_draws_of_another():
    alone = lost_of(5, [1], loss=0.3)
    assert 0 < len(alone) < 100
    assert lost_of(5, [1], loss=0.3, duplicates=0.5) == alone
    link = link_of(delay_s=0.3, delay_shape=2.0)
    rows, _ = sent_over(link, 100, np.array([5]))
    other = link_of(delay_s=0.3, delay_shape=2.0, loss=0.3, duplicates=0.3)
    fewer, _ = sent_over(other, 100, np.array([5]))
    assert set(fewer[:, 1]) < set(rows[:, 1])


def errors_m(steps=2000, numbers=EVERYONE, **keys):
    positions = WrongPositions(Positioning(**keys), COUNT, random_of)
    return np.array([positions.error_m(numbers, step * STEP_S) for step in range(steps)])


def test_a_bias_is_the_error_of_everyone():
    assert (errors_m(3, bias_m=20.0) == 20.0).all()


def test_noise_has_its_deviation_and_its_correlation():
    found = errors_m(noise_m=1.5, correlation_s=4.0)
    assert found.mean() == pytest.approx(0.0, abs=0.1)
    assert found[0].std() == pytest.approx(1.5, rel=0.2)
    assert found.std() == pytest.approx(1.5, rel=0.03)
    for lag in (5, 20):
        correlated = (found[lag:] * found[:-lag]).mean() / found.var()
        assert correlated == pytest.approx(np.exp(-lag * STEP_S / 4.0), abs=0.03)


def test_noise_of_two_vehicles_is_not_alike():
    found = errors_m(noise_m=1.5, correlation_s=1.0)
    assert abs(np.corrcoef(found[:, 0], found[:, 1])[0, 1]) < 0.15


def test_speeds_err_by_their_deviation_each_time_anew():
    positions = WrongPositions(Positioning(speed_noise_mps=0.3), COUNT, random_of)
    found = np.array([positions.speed_error_mps(EVERYONE) for _ in range(500)])
    assert found.std() == pytest.approx(0.3, rel=0.02)
    assert abs((found[1:] * found[:-1]).mean()) < 0.002


def test_outages_are_as_frequent_and_as_long_as_said_and_drift():
    found = errors_m(20000, outages_per_h=60.0, outage_s=8.0, outage_drift_mps=0.5)
    out = found > 0.0
    hours = COUNT * 20000 * STEP_S / 3600.0
    begins = (out[1:] & ~out[:-1]).sum()
    good_share = 1.0 - out.mean()
    assert begins / (hours * good_share) == pytest.approx(60.0, rel=0.05)
    assert out.sum() * STEP_S / begins == pytest.approx(8.0, rel=0.05)
    grows = np.diff(found, axis=0)[out[1:] & out[:-1]]
    assert np.allclose(grows, 0.5 * STEP_S)


def test_an_outage_changes_no_noise_and_neither_do_others_on_the_road():
    plain = errors_m(300, noise_m=1.0)
    out = errors_m(300, noise_m=1.0, outages_per_h=600.0, outage_drift_mps=0.0)
    assert np.array_equal(plain, out)
    alone = errors_m(300, np.array([7]), noise_m=1.0)
    assert np.array_equal(plain[:, [7]], alone)


def clock_errors_s(now_s, **keys):
    return WrongClocks(Clock(**keys), 5000, random_of).error_s(np.arange(5000), now_s)


def test_clocks_are_off_drift_and_jump_as_said():
    assert clock_errors_s(50.0, offset_s=0.2).std() == pytest.approx(0.2, rel=0.03)
    assert clock_errors_s(1000.0, drift_ppm=100.0).std() == pytest.approx(0.1, rel=0.03)
    assert (clock_errors_s(0.0, drift_ppm=100.0) == 0.0).all()
    assert (clock_errors_s(9.9, step_at_s=10.0, step_s=-2.0) == 0.0).all()
    assert (clock_errors_s(10.0, step_at_s=10.0, step_s=-2.0) == -2.0).all()


def test_drift_leaves_offsets_as_they_are():
    plain = clock_errors_s(0.0, offset_s=0.2)
    assert np.array_equal(plain, clock_errors_s(0.0, offset_s=0.2, drift_ppm=100.0))
