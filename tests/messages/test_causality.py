"""Altering a message after a time changes no decision up to then."""

import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import coramp
from coramp.audit.replay import replayed
from coramp.messages.kinds import place_of_each
from coramp.messages.log_reader import read_log
from coramp.strategies.registry import strategies, strategy_named
from tests.messages.test_service import listed

COOPERATIVE = [name for name, strategy in strategies().items() if strategy.cooperative]
STEP_S = 0.1
LAST_STEP = 900


@pytest.fixture(scope="module", params=COOPERATIVE)
def run(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    made = coramp.run(
        "paper",
        request.param,
        engine="exact",
        mainline_veh_h=1500,
        ramp_veh_h=600,
        horizon_s=40,
        keep_messages=True,
    )
    return request.param, made, folder / "messages.parquet"


def decided(name, made, path, frame):
    frame.write_parquet(path)
    log = read_log(path, STEP_S, set(made.vehicles["vehicle_id"]))
    return listed(replayed(log, made.scenario, strategy_named(name)(), LAST_STEP).commands)


def altered(frame, row, how):
    """One message altered: told later, dropped, with another speed, or for a longer vehicle."""
    here = pl.int_range(pl.len()) == row
    if how == "dropped":
        vehicle = frame["vehicle_id"][row]
        if frame["kind"][row] == "request":  # all that is about it goes with it
            return frame.filter(pl.col("vehicle_id").ne_missing(vehicle))
        return frame.filter(~here)
    if how == "later":
        step = round(frame["time_s"][row] / STEP_S) + 5
        vehicle = frame["vehicle_id"][row]
        asks = pl.col("kind") == "request"
        moved = frame.filter((pl.col("vehicle_id").ne_missing(vehicle)) | asks)
        here = (pl.col("vehicle_id") == vehicle) & asks
        moved = moved.with_columns(time_s=pl.when(here).then(step * STEP_S).otherwise("time_s"))
        return moved.sort("time_s", place_of_each(), maintain_order=True)
    return frame.with_columns(pl.when(here).then(pl.col(how) * 1.05).otherwise(how).alias(how))


@settings(
    max_examples=12,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    deadline=None,
)
@given(data=st.data())
def test_the_past_stays(run, data):
    name, made, path = run
    frame = made.messages
    kinds = frame["kind"].to_list()
    rows = [k for k, kind in enumerate(kinds) if kind in ("request", "report")]
    requests = [k for k in rows if kinds[k] == "request"]
    row = data.draw(st.sampled_from(requests) | st.sampled_from(rows))
    how = data.draw(st.sampled_from(["dropped", "speed_mps", "length_m", "later"]))
    if kinds[row] == "report" and how in ("length_m", "later"):
        how = "speed_mps"
    at = round(frame["time_s"][row] / STEP_S)
    before = [c for c in decided(name, made, path, frame) if c[2] < at]
    after = [c for c in decided(name, made, path, altered(frame, row, how)) if c[2] < at]
    assert after == before


def test_altering_a_request_changes_what_comes_after_it(run):
    name, made, path = run
    frame = made.messages
    row = frame["kind"].to_list().index("request")
    assert decided(name, made, path, frame) != decided(
        name, made, path, altered(frame, row, "speed_mps")
    )
