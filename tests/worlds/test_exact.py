"""The exact engine decides as the SUMO engine does, and measures what SUMO drives."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from polars.testing import assert_frame_equal

import coramp

flows = st.tuples(
    st.sampled_from(["paper", "expressway"]),
    st.sampled_from(["mainline-priority", "ramp-priority"]),
    st.integers(400, 3600),
    st.integers(100, 1500),
    st.integers(1, 10_000),
)


def both_engines(case, **more):
    scenario, strategy, mainline, ramp, seed = case
    return [
        coramp.run(
            scenario,
            strategy,
            engine=engine,
            mainline_veh_h=mainline,
            ramp_veh_h=ramp,
            seed=seed,
            horizon_s=90.0,
            **more,
        )
        for engine in ("exact", "sumo")
    ]


@settings(max_examples=12)
@given(flows)
def test_both_engines_decide_alike(case):
    exact, sumo = both_engines(case)
    for table in ("decisions", "trajectories"):
        assert_frame_equal(getattr(exact, table), getattr(sumo, table), abs_tol=1e-9, rel_tol=0.0)
    planned = [c for c in exact.vehicles.columns if c != "plan_error_m"]
    assert_frame_equal(
        exact.vehicles.select(planned), sumo.vehicles.select(planned), abs_tol=1e-9, rel_tol=0.0
    )


@settings(max_examples=6)
@given(flows)
def test_metrics_differ_by_no_more_than_the_tracking_error_allows(case):
    exact, sumo = (run.summary for run in both_engines(case))
    from_the_plan = [
        key
        for key in exact
        if key.endswith(("_delay_s", "_delay_p95_s", "_speed_mps", "_std_mps", "fuel_l"))
        or key.startswith(("rung_", "vehicles_"))
    ]
    assert len(from_the_plan) > 12
    for key in from_the_plan:
        assert exact[key] == pytest.approx(sumo[key], abs=1e-9), key
    assert sumo["plan_error_m"] <= 0.05
    assert exact["plan_error_m"] == 0.0
    if exact["min_margin_m"] is not None:
        # two vehicles, each off by the plan error at most
        tolerance_m = 2 * sumo["plan_error_m"] + 0.01
        assert exact["min_margin_m"] == pytest.approx(sumo["min_margin_m"], abs=tolerance_m)
        assert exact["min_margin_m"] >= 0.1 - 1e-9


def test_the_exact_engine_has_no_drivers():
    with pytest.raises(coramp.CorampError, match="exact has no drivers for uncontrolled"):
        coramp.run("paper", "uncontrolled", engine="exact")


@pytest.mark.parametrize(("option", "word"), [("keep_sumo", "--keep-sumo"), ("gui", "--gui")])
def test_options_of_sumo_are_refused(option, word, tmp_path):
    with pytest.raises(coramp.CorampError, match=f"{word}: the exact engine runs without SUMO"):
        coramp.run("paper", engine="exact", out=tmp_path / "r", **{option: True})
    assert not (tmp_path / "r").exists()
