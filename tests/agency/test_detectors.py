"""Loops from trajectories: worked by hand, and against SUMO's own on the same run."""

import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import sumo

import coramp
from coramp.agency.detectors import detectors_of, detectors_table
from coramp.agency.motion import motion_of
from coramp.agency.sumo_detectors import definition_xml, output_xml, router_csv, router_xml
from coramp.worlds.sumo.network import network_file, road_plan, sumo_binary
from tests.agency import motion_by_hand
from tests.metrics import PAPER, Car

TRAFFIC = {"mainline_veh_h": 1600.0, "ramp_veh_h": 400.0, "horizon_s": 240.0, "seed": 3}


def rows_of(table, detector):
    return table.filter(detector=detector).rows(named=True)


def test_a_loop_counts_fronts_speeds_and_for_how_long_it_is_covered():
    # Both pass -390 m; one at 20 m/s covers it for 0.25 s, one at 10 m/s for 0.5 s.
    cars = [
        Car("m1", [(0.0, -400.0, 20.0, 0.0)], exit_s=40.0),
        Car("m2", [(9.0, -400.0, 10.0, 0.0)], entry_s=9.0, exit_s=89.0),
    ]
    table = detectors_table(motion_by_hand(cars, 89.0), 10.0)
    first, second = rows_of(table, "mainline_in")[:2]
    assert (first["vehicles"], first["passed"], second["vehicles"], second["passed"]) == (
        1,
        1,
        1,
        1,
    )
    assert first["flow_veh_h"] == pytest.approx(360.0)
    assert first["mean_speed_mps"] == pytest.approx(20.0)
    assert first["occupancy_percent"] == pytest.approx(2.5)
    assert second["occupancy_percent"] == pytest.approx(5.0)
    whole = rows_of(detectors_table(motion_by_hand(cars, 89.0)), "mainline_in")[0]
    assert whole["mean_speed_mps"] == pytest.approx(15.0)
    assert whole["harmonic_speed_mps"] == pytest.approx(2.0 / (1 / 20.0 + 1 / 10.0))
    assert whole["mean_length_m"] == 5.0


def test_a_loop_of_the_mainline_does_not_see_the_acceleration_lane():
    # Merges at 5 s, 80 m behind the nose: it passes 150 m on the mainline, 0 m on the ramp.
    car = Car("r1", [(0.0, 0.0, 16.0, 0.0)], merge_s=5.0, exit_s=25.0)
    late = Car("r2", [(0.0, 0.0, 16.0, 0.0)], merge_s=10.0, exit_s=25.0)
    assert PAPER.detector_station_m == 150.0
    table = detectors_table(motion_by_hand([car, late], 25.0))
    assert rows_of(table, "mainline_merge")[0]["vehicles"] == 1
    assert rows_of(table, "mainline_out")[0]["vehicles"] == 2


def test_places_are_those_of_sumos_network():
    found = {d.name: (d.lane, d.position_m, d.kind) for d in detectors_of(PAPER)}
    assert found == {
        "mainline_in": ("mainline_0", 10.0, "source"),
        "mainline_upstream": ("mainline_0", 200.0, "between"),
        "ramp_in": ("ramp_0", 10.0, "source"),
        "mainline_merge": ("merge_1", 150.0, ""),
        "mainline_out": ("downstream_0", 170.0, "sink"),
    }


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A run of drivers whose files are kept, and what SUMO's own loops counted in it."""
    folder = tmp_path_factory.mktemp("loops") / "run"
    run = coramp.run(
        "paper", "uncontrolled", drivers="credible", out=folder, keep_sumo=True, **TRAFFIC
    )
    place = folder / "sumo"
    loops = detectors_of(run.scenario)
    (place / "own.add.xml").write_text(definition_xml(loops, 60.0, "own.xml"))
    command = shlex.split((place / "command.txt").read_text())
    command = [sumo_binary("sumo"), *command[1:], "--additional-files", "own.add.xml"]
    subprocess.run(command, cwd=place, check=True, capture_output=True)
    return run, ET.parse(place / "own.xml").getroot().findall("interval")


def test_loops_count_what_sumos_loops_count(kept):
    """But for who passes at an interval's very edge: positions are kept within 5 cm."""
    run, intervals = kept
    table = detectors_table(motion_of(run), 60.0)
    theirs = {(i.get("id"), float(i.get("begin"))): i for i in intervals}
    whole = [r for r in table.iter_rows(named=True) if r["to_s"] - r["from_s"] == 60.0]
    assert len(whole) == 20
    for own in whole:
        sumos = theirs[own["detector"], own["from_s"]]
        assert own["vehicles"] == pytest.approx(int(sumos.get("nVehEntered")), abs=1)
        assert own["passed"] == pytest.approx(int(sumos.get("nVehContrib")), abs=1)
        assert own["occupancy_percent"] == pytest.approx(float(sumos.get("occupancy")), abs=0.4)
        assert own["mean_speed_mps"] == pytest.approx(float(sumos.get("speed")), abs=0.3)
        assert own["mean_length_m"] == pytest.approx(float(sumos.get("length")))
    for loop in detectors_of(run.scenario):
        entered = sum(int(i.get("nVehEntered")) for i in intervals if i.get("id") == loop.name)
        assert table.filter(detector=loop.name)["vehicles"].sum() == entered > 20


def test_the_output_is_written_as_sumo_writes_it(kept):
    run, intervals = kept
    written = ET.fromstring(output_xml(detectors_table(motion_of(run), 60.0)))
    assert {i.tag for i in written} == {"interval"}
    assert list(written[0].attrib) == list(intervals[0].attrib)
    assert [i.get("id") for i in written[:5]] == [i.get("id") for i in intervals[:5]]


def test_flowrouter_reads_what_is_exported(kept, tmp_path):
    """SUMO's own tool finds flows that go from both sources to the sink."""
    run, _ = kept
    loops, table = detectors_of(run.scenario), detectors_table(motion_of(run), 60.0)
    (tmp_path / "det.xml").write_text(router_xml(loops))
    (tmp_path / "flows.csv").write_text(router_csv(table))
    tool = Path(sumo.SUMO_HOME) / "tools" / "detector" / "flowrouter.py"
    subprocess.run(
        [
            *(sys.executable, str(tool), "-n", str(network_file(road_plan(run.scenario)))),
            *("-d", "det.xml", "-f", "flows.csv", "-o", "routes.xml", "-e", "emitted.xml"),
        ],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    flows = ET.parse(tmp_path / "emitted.xml").getroot().findall("flow")
    emitted = {flow.get("id").split("_")[0]: int(flow.get("number")) for flow in flows}
    assert emitted == {
        stream: table.filter(detector=f"{stream}_in")["vehicles"].sum()
        for stream in ("mainline", "ramp")
    }


def test_counts_for_routers_are_in_minutes_and_km_h():
    cars = [Car("m1", [(0.0, -400.0, 20.0, 0.0)], exit_s=40.0)]
    lines = router_csv(detectors_table(motion_by_hand(cars, 40.0), 30.0)).splitlines()
    assert lines[0] == "Detector;Time;qPKW;qLKW;vPKW;vLKW"
    assert lines[1] == "mainline_in;0;1;0;72.00;0.00"
    assert "mainline_out;0.5;1;0;72.00;0.00" in lines
