"""Every key of a world that fails: which test shows what it does, and that it costs no distance.

What a fault costs is time. The answer to each is that an automated vehicle keeps its distances
whatever it hears and is told, unless a driver breaks what it may rely on.
"""

import ast
from pathlib import Path

import pytest

from coramp.runs.running import execute, make_spec
from coramp.scenarios.world_sections import TABLES

TESTS = Path(__file__).parents[1]
AIR, LINKS = "worlds/test_faulty_air.py", "worlds/test_faulty_links.py"
CARELESS, SLOW = "worlds/test_careless.py", "mixed/test_slow_actuators.py"
EFFECTS = {
    "world.preset": ("edges/test_world_input.py", "test_every_preset_is_a_scenario"),
    "positioning.bias_m": (AIR, "test_a_bias_of_20_m_is_20_m_in_what_the_coordinator_hears"),
    "positioning.noise_m": (AIR, "test_noise_is_in_what_the_coordinator_hears"),
    "positioning.correlation_s": (LINKS, "test_noise_has_its_deviation_and_its_correlation"),
    "positioning.speed_noise_mps": (AIR, "test_noise_of_a_speed_is_in_what_the_coordinator_hears"),
    "positioning.outages_per_h": (
        LINKS,
        "test_outages_are_as_frequent_and_as_long_as_said_and_drift",
    ),
    "positioning.outage_s": (LINKS, "test_outages_are_as_frequent_and_as_long_as_said_and_drift"),
    "positioning.outage_drift_mps": (
        LINKS,
        "test_outages_are_as_frequent_and_as_long_as_said_and_drift",
    ),
    "clock.offset_s": (LINKS, "test_clocks_are_off_drift_and_jump_as_said"),
    "clock.drift_ppm": (LINKS, "test_clocks_are_off_drift_and_jump_as_said"),
    "clock.step_at_s": (LINKS, "test_clocks_are_off_drift_and_jump_as_said"),
    "clock.step_s": (AIR, "test_a_clock_that_is_wrong_shifts_the_stamp_and_so_the_station"),
    "reports.delay_s": (LINKS, "test_latency_has_the_mean_that_is_said"),
    "reports.delay_shape": (LINKS, "test_messages_with_a_drawn_latency_overtake_one_another"),
    "reports.loss": (LINKS, "test_the_share_that_is_lost_is_the_loss"),
    "reports.burst_s": (LINKS, "test_losses_come_in_bursts_of_the_mean_length"),
    "reports.duplicates": (LINKS, "test_messages_come_twice_as_often_as_said"),
    "reports.period_s": (AIR, "test_a_vehicle_reports_once_a_period"),
    "reports.stale_s": (AIR, "test_stale_reports_are_forgotten"),
    "commands.delay_s": (AIR, "test_a_command_acts_when_it_arrives"),
    "commands.delay_shape": (LINKS, "test_messages_with_a_drawn_latency_overtake_one_another"),
    "commands.loss": (AIR, "test_losses_are_counted"),
    "commands.burst_s": (LINKS, "test_losses_come_in_bursts_of_the_mean_length"),
    "commands.duplicates": (LINKS, "test_messages_come_twice_as_often_as_said"),
    "commands.valid_s": (AIR, "test_an_overdue_command_leads_to_a_fallback_that_is_counted_once"),
    "actuators.dead_time_s": (SLOW, "test_a_dead_time_moves_a_step_by_itself"),
    "actuators.lag_s": (SLOW, "test_a_lag_answers_a_step_exponentially"),
    "road.adhesion": (
        CARELESS,
        "test_adhesion_limits_what_is_driven_and_assumed_adhesion_keeps_the_distance",
    ),
    "road.assumed_adhesion": (
        "worlds/test_mixed_setup.py",
        "test_on_a_slippery_road_nobody_is_taken_to_brake_harder_than_it_lets_them",
    ),
    "behaviour.never_yields_share": (
        CARELESS,
        "test_the_share_that_never_yields_has_that_in_sumos_routes",
    ),
    "behaviour.inattentive_share": (
        CARELESS,
        "test_the_share_that_is_inattentive_has_that_in_sumos_routes",
    ),
    "behaviour.inattentive_s": (
        CARELESS,
        "test_the_share_that_is_inattentive_has_that_in_sumos_routes",
    ),
    "behaviour.brakes_for_nothing_per_h": (
        "worlds/test_brakings.py",
        "test_a_run_has_the_brakings_that_are_due_until_vehicles_stop_arriving",
    ),
    "behaviour.brake_mps2": (
        CARELESS,
        "test_a_driver_brakes_for_nothing_as_hard_and_long_as_said",
    ),
    "behaviour.brake_s": (CARELESS, "test_a_driver_brakes_for_nothing_as_hard_and_long_as_said"),
    "behaviour.silent_share": (
        AIR,
        "test_the_share_that_falls_silent_does_not_report_and_hears_nothing",
    ),
    "behaviour.disobeys_share": (
        AIR,
        "test_the_share_that_disobeys_reports_but_does_not_do_what_it_is_told",
    ),
    "behaviour.lies_share": (
        AIR,
        "test_the_share_that_lies_reports_a_station_that_is_wrong_by_the_lie",
    ),
    "behaviour.lie_m": (AIR, "test_the_share_that_lies_reports_a_station_that_is_wrong_by_the_lie"),
    "incidents.breakdown_s": (CARELESS, "test_a_vehicle_breaks_down_where_and_when_it_is_said"),
    "incidents.place": (CARELESS, "test_a_vehicle_breaks_down_where_and_when_it_is_said"),
    "incidents.station_m": (CARELESS, "test_a_vehicle_breaks_down_where_and_when_it_is_said"),
    "incidents.lasts_s": (CARELESS, "test_a_vehicle_breaks_down_where_and_when_it_is_said"),
}
"""By key, the test that shows its effect on the world."""
STRONG = {
    "world.preset": {"world.preset": "hard"},
    "positioning.bias_m": {"positioning.bias_m": 20.0},
    "positioning.noise_m": {"positioning.noise_m": 10.0},
    "positioning.correlation_s": {"positioning.noise_m": 10.0, "positioning.correlation_s": 0.2},
    "positioning.speed_noise_mps": {"positioning.speed_noise_mps": 5.0},
    "positioning.outages_per_h": {
        "positioning.outages_per_h": 200.0,
        "positioning.outage_drift_mps": 5.0,
    },
    "positioning.outage_s": {"positioning.outages_per_h": 60.0, "positioning.outage_s": 30.0},
    "positioning.outage_drift_mps": {
        "positioning.outages_per_h": 60.0,
        "positioning.outage_drift_mps": 15.0,
    },
    "clock.offset_s": {"clock.offset_s": 1.0},
    "clock.drift_ppm": {"clock.drift_ppm": 10000.0},
    "clock.step_at_s": {"clock.step_at_s": 30.0, "clock.step_s": -2.0},
    "clock.step_s": {"clock.step_s": -2.0},
    "reports.delay_s": {"reports.delay_s": 2.0},
    "reports.delay_shape": {"reports.delay_s": 1.0, "reports.delay_shape": 0.5},
    "reports.loss": {"reports.loss": 0.9},
    "reports.burst_s": {"reports.loss": 0.5, "reports.burst_s": 10.0},
    "reports.duplicates": {
        "reports.duplicates": 1.0,
        "reports.delay_s": 0.5,
        "reports.delay_shape": 1.0,
    },
    "reports.period_s": {"reports.period_s": 2.5},
    "reports.stale_s": {"reports.stale_s": 0.1, "reports.period_s": 1.0},
    "commands.delay_s": {"commands.delay_s": 1.2},
    "commands.delay_shape": {"commands.delay_s": 1.0, "commands.delay_shape": 0.5},
    "commands.loss": {"commands.loss": 0.9},
    "commands.burst_s": {"commands.loss": 0.5, "commands.burst_s": 10.0},
    "commands.duplicates": {
        "commands.duplicates": 1.0,
        "commands.delay_s": 0.5,
        "commands.delay_shape": 1.0,
    },
    "commands.valid_s": {"commands.valid_s": 30.0, "commands.loss": 0.9},
    "actuators.dead_time_s": {"actuators.dead_time_s": 1.0},
    "actuators.lag_s": {"actuators.lag_s": 1.0},
    "road.adhesion": {"road.adhesion": 0.7},
    "road.assumed_adhesion": {"road.assumed_adhesion": 0.3, "road.adhesion": 0.3},
    "behaviour.never_yields_share": {"behaviour.never_yields_share": 1.0},
    "behaviour.inattentive_share": {"behaviour.inattentive_share": 1.0},
    "behaviour.inattentive_s": {
        "behaviour.inattentive_share": 0.5,
        "behaviour.inattentive_s": 1.5,
    },
    "behaviour.brakes_for_nothing_per_h": {"behaviour.brakes_for_nothing_per_h": 300.0},
    "behaviour.brake_mps2": {
        "behaviour.brakes_for_nothing_per_h": 200.0,
        "behaviour.brake_mps2": 6.0,
    },
    "behaviour.brake_s": {
        "behaviour.brakes_for_nothing_per_h": 120.0,
        "behaviour.brake_s": 4.0,
    },
    "behaviour.silent_share": {"behaviour.silent_share": 1.0},
    "behaviour.disobeys_share": {"behaviour.disobeys_share": 1.0},
    "behaviour.lies_share": {"behaviour.lies_share": 0.5},
    "behaviour.lie_m": {"behaviour.lies_share": 0.5, "behaviour.lie_m": -60.0},
    "incidents.breakdown_s": {"incidents.breakdown_s": 30.0, "incidents.lasts_s": 20.0},
    "incidents.place": {
        "incidents.breakdown_s": 30.0,
        "incidents.place": "ramp",
        "incidents.station_m": 120.0,
        "incidents.lasts_s": 20.0,
    },
    "incidents.station_m": {
        "incidents.breakdown_s": 30.0,
        "incidents.station_m": 100.0,
        "incidents.lasts_s": 20.0,
    },
    "incidents.lasts_s": {"incidents.breakdown_s": 20.0, "incidents.lasts_s": 60.0},
}
"""By key, a world in which it is far worse than in any preset."""
KEYS = [f"{table}.{key}" for table, kind in TABLES.items() for key in kind.model_fields]


def named_in(path):
    tree = ast.parse((TESTS / path).read_text())
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_key_has_a_test_of_its_effect():
    assert set(EFFECTS) == set(KEYS)
    for key, (path, name) in EFFECTS.items():
        assert name in named_in(path), key


def test_every_key_has_a_test_of_the_answer_to_it():
    assert set(STRONG) == set(KEYS)
    for key, settings in STRONG.items():
        assert key in settings


@pytest.mark.parametrize("key", KEYS)
def test_a_fault_costs_no_distance(key):
    shares = {
        "traffic.automated_share": 0.5,
        "safety.time_gap_s": 0.5,
        "safety.standstill_gap_m": 2.0,
    }
    spec = make_spec(
        "paper",
        "mixed-slots",
        overrides={**shares, **STRONG[key]},
        mainline_veh_h=1900.0,
        ramp_veh_h=600.0,
        seed=5,
        horizon_s=60.0,
    )
    tables, row = execute(spec)
    assert row["collisions_by_automated"] == 0
    assert row["automated_violations"] == 0
    assert row["plan_error_m"] < 0.05
    assert tables.vehicles["entry_s"].is_not_null().all()
