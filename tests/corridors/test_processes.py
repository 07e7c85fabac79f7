"""Each site's coordinator answers what it is told, wherever it runs."""

import numpy as np
import pytest

import coramp
from coramp.worlds.sumo import corridor as running
from coramp.worlds.sumo.corridor_sites import SiteCoordinator, SitesHere
from tests.corridors import written

AT_A10KW = {
    "sites": ["24498409@4054057", "308396220@264308374"],
    "mainline_flow_veh_h": [3000.0, 2400.0],
    "ramp_flow_veh_h": [600.0, 600.0],
    "exits": [{"edge": "151495034", "share": 0.1}],
}
FAULTS = {"world": {"preset": "gnss-its-g5"}}


def same(one, two):
    """Whether two runs have the same figures, bit for bit."""
    assert one.summary == two.summary
    assert one.frames.keys() == two.frames.keys()
    return all(one.frames[name].equals(two.frames[name]) for name in one.frames)


@pytest.mark.parametrize("tables", [{}, FAULTS], ids=["perfect", "faults"])
def test_two_ramps_at_a10kw_give_the_same_figures_in_one_process_and_in_two(
    tmp_path, a10kw, tables
):
    path = written(tmp_path, a10kw, 0.5, 60.0, tables, **AT_A10KW)
    one, two = coramp.corridor(path), coramp.corridor(path, processes=2)
    assert same(one, two)
    assert one.sites["taken_over"].min() > 20
    assert one.sites["commands_sent"].min() > 500
    assert (one.sites["commands_lost"].min() > 0) is bool(tables)


def test_more_processes_than_sites_and_another_seed(tmp_path, network):
    path = written(tmp_path, network, horizon_s=30.0)
    one, many = coramp.corridor(path, seed=2), coramp.corridor(path, seed=2, processes=5)
    assert same(one, many)
    assert not same_tables(one, coramp.corridor(path, seed=3))


def same_tables(one, two):
    return all(one.frames[name].equals(two.frames[name]) for name in one.frames)


class Overheard(SitesHere):
    """Keeps what each site is told and answers."""

    def __init__(self, setups):
        super().__init__(setups)
        self.setups, self.heard = setups, [[] for _ in setups]
        kept.append(self)

    def handle(self, views):
        answers = super().handle(views)
        for own, view, answer in zip(self.heard, views, answers, strict=True):
            own.append((view, answer))
        return answers


kept = []


def test_a_coordinator_knows_its_zone_alone_and_what_it_is_told(tmp_path, network, monkeypatch):
    """Alone, and told the same, it answers the same: nothing else reaches it."""
    kept.clear()
    monkeypatch.setattr("coramp.worlds.sumo.corridor_sites.SitesHere", Overheard)
    result = coramp.corridor(written(tmp_path, network, horizon_s=60.0))
    (overheard,) = kept
    lengths_m = dict(zip(result.sites["site"], result.sites["zone_m"], strict=True))
    for setup, heard in zip(overheard.setups, overheard.heard, strict=True):
        alone = SiteCoordinator(setup)
        for view, answer in heard:
            again = alone.handle(view)
            np.testing.assert_array_equal(again.accel_mps2, answer.accel_mps2)
            np.testing.assert_array_equal(again.changes, answer.changes)
            station_m = view.users.station_m
            if len(station_m):
                assert station_m.min() >= -300.0
                assert np.ptp(station_m) <= lengths_m[setup.scenario.network.ramp] + 100.0
        assert any(answer.changes.any() for _, answer in heard)


def test_a_vehicle_is_the_same_at_all_sites_and_links_are_not(tmp_path, network, monkeypatch):
    """Who disobeys at one site disobeys at the next; what is lost at one is not lost at both."""
    tables = {"behaviour": {"disobeys_share": 0.5}, "commands": {"loss": 0.2}}
    kept.clear()
    monkeypatch.setattr("coramp.worlds.sumo.corridor_sites.SitesHere", Overheard)
    result = coramp.corridor(written(tmp_path, network, 1.0, 30.0, tables))
    first, second = (site._air for site in kept[0]._sites)
    np.testing.assert_array_equal(first._disobeys, second._disobeys)
    assert 0.2 < first._disobeys.mean() < 0.8
    lost = result.sites["commands_lost"] / result.sites["commands_sent"]
    assert lost.to_list() == pytest.approx([0.2, 0.2], abs=0.05)
    assert lost[0] != lost[1]


def test_a_process_that_ends_is_told_in_one_line(tmp_path, network, monkeypatch):
    def gone(plant, sites, *_):
        for line in sites._lines:
            line.send_bytes(b"no view")  # what no process can read
        return sites.handle([None, None])

    monkeypatch.setattr(running, "_drive", gone)
    with pytest.raises(
        coramp.CorampError, match=r"^--processes: a coordinator's process has ended"
    ):
        coramp.corridor(written(tmp_path, network, horizon_s=10.0), processes=2)
