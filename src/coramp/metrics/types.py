"""What vehicles of a run can do, their free flow and their fuel, type by type."""

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.kinematics.fuel import FUEL_MODELS
from coramp.kinematics.trajectory import MAX_PIECES, begin, drive, time_at_station
from coramp.motion.following import speed_up
from coramp.records.outcome import Passages
from coramp.records.schemas import Row
from coramp.road.rules import packed, unpacked
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.vehicles.traits import ACCELERATION, LENGTH, POWER, TOP_SPEED, Traits, cruise_mps


def traits_of(passages: Passages, scenario: Scenario) -> FloatArray:
    """Returns what each vehicle can do, one row per vehicle (``vehicles.traits``)."""
    usual = scenario.usual_traits(0.0)
    rows = np.tile(np.array(usual, np.float64), (len(passages), 1))
    rows[:, LENGTH] = passages.length_m
    for place, own in enumerate(passages.traits):
        if own is not None:
            rows[place] = own
    return rows


def trait_columns(traits: FloatArray) -> dict[str, FloatArray]:
    """Returns the columns of a table: nan, there null, where nothing binds a vehicle."""
    known = np.where(np.isinf(traits), np.nan, traits)
    return {name: known[:, k] for k, name in enumerate(Traits._fields)}


def fuel_models_of(passages: Passages, scenario: Scenario) -> IntArray:
    """Returns the place of each vehicle's model of fuel in ``FUEL_MODELS``.

    Raises CorampError for a type that the scenario does not have.
    """
    names = passages.types()
    of_type = {name: FUEL_MODELS.index(scenario.type_named(name).fuel) for name in set(names)}
    return np.array([of_type[name] for name in names], np.int64)


def free_flow_of_each_s(passages: Passages, traits: FloatArray, scenario: Scenario) -> FloatArray:
    """Returns each vehicle's time (s) through the zone if it were alone.

    On the mainline that is the distance over its cruising speed. On the ramp it drives v_R0, or its
    own top speed, and from the nose on it speeds up as in free movement, or as it can.
    """
    free_s = np.where(passages.on_ramp, scenario.ramp_free_flow_s, scenario.mainline_free_flow_s)
    bound = ~np.isinf(traits[:, [TOP_SPEED, ACCELERATION, POWER]]).all(axis=1)
    packed_rules = packed(scenario.rules())
    for place in np.flatnonzero(bound).tolist():
        free_s[place] = own_free_flow_s(traits[place], bool(passages.on_ramp[place]), packed_rules)
    return free_s


@kernel
def own_free_flow_s(traits: FloatArray, on_ramp: bool, packed_rules: FloatArray) -> float:
    """Returns the time (s) of one vehicle through the zone if it were alone."""
    end_m = unpacked(packed_rules).road.mainline_end_m
    return free_time_to_s(end_m, traits, on_ramp, packed_rules)


@kernel
def free_time_to_s(
    station_m: float, traits: FloatArray, on_ramp: bool, packed_rules: FloatArray
) -> float:
    """Returns the time (s) of one vehicle from its stream's start to a station if it were alone."""
    rules = unpacked(packed_rules)
    road, cruise = rules.road, cruise_mps(traits, rules)
    if not on_ramp:
        return float((station_m - road.mainline_start_m) / cruise)
    out = np.empty((MAX_PIECES, 4))
    ramp_mps = min(road.ramp_speed_mps, traits[TOP_SPEED])
    n = begin(out, 0.0, road.ramp_start_m, ramp_mps)
    n = drive(out, n, 0.0, -road.ramp_start_m / ramp_mps)
    n = speed_up(out, n, cruise, rules.motion.free_acceleration_mps2, traits)
    return float(time_at_station(out[:n], station_m))


def type_figures(
    passages: Passages, delay_s: FloatArray, fuel_l: FloatArray, finished: BoolArray
) -> list[Row]:
    """Returns one row per type of vehicle and stream: how many, their mean delay and their fuel."""
    kinds = np.array(passages.types(), object)
    rows = []
    for kind in sorted(set(kinds.tolist())):
        for on_ramp in (False, True):
            own = (kinds == kind) & (passages.on_ramp == on_ramp)
            if own.any():
                rows.append(
                    {
                        "vehicle_type": kind,
                        "stream": STREAMS[on_ramp],
                        "vehicles": int(own.sum()),
                        "unserved": int((~finished[own]).sum()),
                        "delay_s": float(delay_s[own].mean()),
                        "fuel_l": float(fuel_l[own].sum()),
                    }
                )
    return rows
