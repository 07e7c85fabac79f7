"""Automated vehicles that nobody coordinates: how SUMO drives them; they promise nothing."""

import pytest

import coramp
from coramp.errors import CorampError
from coramp.runs.beforehand import without_effect_on_drivers
from coramp.runs.running import broken_promises, make_spec

SHORT = {"mainline_veh_h": 1800.0, "ramp_veh_h": 500.0, "horizon_s": 120.0}
BALLISTIC = {"drivers.fair.integrator": "ballistic"}
GAPS = {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0}


def alone(share, automation="yielding", **more):
    overrides = {"traffic.automated_share": share, "traffic.automation": automation, **GAPS}
    return coramp.run("paper", "uncontrolled", overrides=overrides, **SHORT, **more)


@pytest.mark.parametrize(
    ("automation", "attributes"),
    [
        ("yielding", 'sigma="0" tau="0.5" minGap="2.0" lcCooperative="1.0"'),
        ("not-yielding", 'sigma="0" tau="0.5" minGap="2.0" lcCooperative="0.0"'),
        ("acc", 'carFollowModel="ACC" tau="0.5" minGap="2.0" lcCooperative="1.0"'),
        ("cacc", 'carFollowModel="CACC" tau="0.5" minGap="2.0" lcCooperative="1.0"'),
    ],
)
def test_automation_is_what_sumo_is_told(automation, attributes, tmp_path):
    alone(0.5, automation, out=tmp_path / "r", keep_sumo=True)
    (routes,) = (tmp_path / "r").rglob("*.rou.xml")
    types = [line for line in routes.read_text().splitlines() if 'id="automated-' in line]
    assert types
    assert all(attributes in line for line in types)


def test_how_automation_drives_makes_a_difference():
    delays = {alone(0.5, kind).summary["delay_s"] for kind in ("yielding", "acc", "cacc")}
    assert len(delays) == 3


def test_at_a_share_of_one_all_are_automated():
    summary = alone(1.0).summary
    vehicles = summary["vehicles_mainline"] + summary["vehicles_ramp"]
    assert summary["automated_vehicles"] == vehicles
    assert summary["delay_s"] == summary["automated_delay_s"]
    assert summary["delay_s"] < alone(0.9).summary["delay_s"]


def test_without_a_share_all_have_drivers_whatever_automated_vehicles_would_do():
    told = coramp.run("paper", "uncontrolled", overrides=GAPS, **SHORT)
    plain = coramp.run("paper", "uncontrolled", **SHORT)
    assert told.summary["automated_vehicles"] is None
    assert told.summary["delay_s"] == plain.summary["delay_s"]


def test_ballistic_drivers_are_refused_at_a_share_of_one_too():
    with pytest.raises(CorampError, match="allowed is euler"):
        make_spec("paper", "uncontrolled", overrides={"traffic.automated_share": 1.0, **BALLISTIC})
    make_spec("paper", "uncontrolled", overrides=BALLISTIC)


def test_settings_of_automated_vehicles_are_not_called_without_effect():
    spec = make_spec("paper", "uncontrolled", overrides={"traffic.automated_share": 1.0, **GAPS})
    assert without_effect_on_drivers([spec]) is None
    assert without_effect_on_drivers([make_spec("paper", "uncontrolled", overrides=GAPS)])


def test_who_nobody_coordinates_promises_nothing():
    row = {"status": "ok", "drivers": "fair", "collisions": 0, "automated_violations": 3}
    assert broken_promises({**row, "plan_error_m": None}) == []
    assert broken_promises({**row, "plan_error_m": 0.0}) == [
        "3 pairs nearer than automated vehicles promise"
    ]
