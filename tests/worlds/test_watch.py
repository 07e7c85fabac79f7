"""What is noted of a run in memory is what SUMO itself writes of it."""

import pytest

from coramp.scenarios.loading import load_scenario
from coramp.strategies.mixed_slots import MixedSlots
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.mixed import begun
from coramp.worlds.sumo.mixed_plant import MixedPlant

EVERYONE_LEAVES = {"simulation.horizon_s": 15.0}
CUT_OFF = {"simulation.horizon_s": 15.0, "simulation.drain_s": 5.0}


@pytest.mark.parametrize("lanes", [1, 3])
@pytest.mark.parametrize("chosen", [EVERYONE_LEAVES, {**CUT_OFF, "actuators.lag_s": 0.3}])
def test_positions_in_memory_are_those_that_sumo_writes(tmp_path, lanes, chosen):
    scenario = load_scenario(
        "paper",
        {
            "mainline.lanes": lanes,
            "mainline.flow_veh_h": 1500.0 * lanes,
            "ramp.flow_veh_h": 600.0,
            "traffic.automated_share": 0.5,
            **chosen,
        },
    )
    options = SumoOptions(keep_in=tmp_path / "kept")
    (tmp_path / "run").mkdir()
    with begun(scenario, MixedSlots(), "credible", 3, options, tmp_path / "run") as run:
        for moment in run.decisions():
            run.carry_out(moment)
    watch, files, arrivals = run.plant.watch, run.files, run.arrivals
    written, noted = files.samples(arrivals), watch.samples()
    assert len(noted.vehicle) > 1000
    for name in ("vehicle", "lane", "time_s", "station_m", "speed_mps"):
        assert getattr(noted, name).tolist() == getattr(written, name).tolist()
    assert watch.finished().tolist() == files.finished(arrivals).tolist()
    assert watch.finished().all() == ("actuators.lag_s" not in chosen)


@pytest.mark.parametrize("lanes", [1, 3])
def test_who_acts_rarely_drives_the_same_way_bit_for_bit(monkeypatch, tmp_path, lanes):
    scenario = load_scenario(
        "paper",
        {
            "mainline.lanes": lanes,
            "mainline.flow_veh_h": 1700.0 * lanes,
            "ramp.flow_veh_h": 900.0,
            "simulation.horizon_s": 25.0,
            "actuators.lag_s": 0.1,
        },
    )

    def driven(folder):
        folder.mkdir()
        with begun(scenario, MixedSlots(), "credible", 3, SumoOptions(), folder) as run:
            for moment in run.decisions():
                run.carry_out(moment)
        return run.plant, run.plant.watch.samples()

    rarely, samples = driven(tmp_path / "rarely")
    assert rarely._acts_rarely.mean() > 0.5
    monkeypatch.setattr(MixedPlant, "_act", lambda *_: None)
    always, expected = driven(tmp_path / "always")
    assert not always._acts_rarely.any()
    for name in ("vehicle", "lane", "time_s", "station_m", "speed_mps"):
        assert getattr(samples, name).tolist() == getattr(expected, name).tolist()
