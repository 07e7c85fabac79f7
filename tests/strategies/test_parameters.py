"""What strategies can be told, and what is said about what they cannot."""

import pytest

from coramp.errors import CorampError
from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario
from coramp.strategies.parameters import parameters_of, wrong_settings
from coramp.strategies.registry import strategies, strategy_named

WRONG = {
    "strategy.alinea.gian_veh_h=70": "strategy.alinea.gian_veh_h: there is no such parameter; "
    "allowed are target_occupancy_percent, gain_veh_h",
    "strategy.alinea.gain_veh_h=-1": r"strategy.alinea.gain_veh_h: -1.* cannot be; allowed is a "
    "number from 1 to 1000",
    "strategy.milp-sequence.ramp_vehicles=2.5": "allowed is a whole number from 1 to 12",
    "strategy.milp-sequence.ramp_vehicles=true": "allowed is a whole number from 1 to 12",
    "strategy.game.risk_weight=much": "allowed is a number from 0.001 to 1000",
    "strategy.mainline-priority.patience=3": "allowed are none: the strategy has no parameters",
    "strategy.alineo.gain_veh_h=70": "strategy: there is no 'alineo'",
}


@pytest.mark.parametrize("setting", WRONG)
def test_what_cannot_be_is_refused_by_name(setting):
    key, _, text = setting.partition("=")
    value = {"true": True, "much": "much"}.get(text)
    with pytest.raises(CorampError, match=WRONG[setting]):
        load_scenario("paper", {key: float(text) if value is None else value})


def test_every_default_is_allowed():
    for strategy in strategies().values():
        assert wrong_settings(strategy, {p.name: p.default for p in parameters_of(strategy)}) == []


def test_parameters_reach_the_strategy_and_the_run():
    flows = {"mainline_veh_h": 1800.0, "ramp_veh_h": 700.0, "seed": 3, "horizon_s": 120.0}
    plain = make_spec("paper", "virtual-platoon", engine="exact", **flows)
    wide = make_spec(
        "paper",
        "virtual-platoon",
        engine="exact",
        overrides={"strategy.virtual-platoon.time_gap_s": 1.4},
        **flows,
    )
    assert plain.run_id != wide.run_id
    assert wide.keys["overrides"] == "strategy.virtual-platoon.time_gap_s=1.4"
    assert execute(wide)[1]["fuel_l"] != execute(plain)[1]["fuel_l"]


def test_strategies_with_parameters_are_values():
    alinea = strategy_named("alinea")
    assert alinea() == alinea()
    assert alinea(gain_veh_h=50.0) != alinea()
