"""What demand over time says of a scenario as a whole: its flows, and how long vehicles arrive."""

from collections.abc import Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.road.streams import STREAMS
from coramp.scenarios.listed import FLOWS, LIST, lists_arrivals
from coramp.scenarios.measured import COUNTS, DEMAND

SIMULATION, HORIZON = "simulation", "horizon_s"


def gives_demand(data: Mapping[str, Any]) -> bool:
    """Returns whether the content of a scenario file has demand over time."""
    return bool(data.get(DEMAND))


def with_demand_flows(
    data: Mapping[str, Any], label: str, origins: Mapping[str, str]
) -> dict[str, Any]:
    """Returns the data with the mean flows (veh/h) of its demand, and its end as the horizon.

    A horizon that is given stays. ``origins`` says who set a dotted key. Raises CorampError where a
    flow or a list of arrivals is given beside demand.
    """
    if not gives_demand(data):
        return dict(data)
    _check_alone(data, label, origins)
    parts = [part for part in data[DEMAND] if isinstance(part, Mapping)]
    simulation = data.get(SIMULATION, {})
    if not isinstance(simulation, Mapping) or not all(_is_valid(part) for part in parts):
        return _with_flows(data, dict.fromkeys(STREAMS, 0.0))  # told by the scenario's checks
    horizon_s = simulation.get(HORIZON, max(part["end_s"] for part in parts))
    result = {**data, SIMULATION: {**simulation, HORIZON: float(horizon_s)}}
    if not _is_number(horizon_s) or horizon_s <= 0.0:
        result[SIMULATION] = {**simulation, HORIZON: horizon_s}
        return _with_flows(result, dict.fromkeys(STREAMS, 0.0))
    flows = {
        stream: sum(
            _vehicles_until(part, horizon_s) for part in parts if part.get("route") == stream
        )
        * (3600.0 / horizon_s)
        for stream in STREAMS
    }
    return _with_flows(result, flows)


def _with_flows(data: Mapping[str, Any], flows_veh_h: Mapping[str, float]) -> dict[str, Any]:
    tables = {
        stream: {**data[stream], "flow_veh_h": float(flow)}
        for stream, flow in flows_veh_h.items()
        if isinstance(data.get(stream), Mapping)
    }
    return {**data, **tables}


def _check_alone(data: Mapping[str, Any], label: str, origins: Mapping[str, str]) -> None:
    what = f"[{COUNTS}]" if COUNTS in data else f"[[{DEMAND}]]"
    if lists_arrivals(data):
        raise CorampError(
            f"{origins.get(LIST, label)}: {LIST}: beside {what}; allowed is one of the two"
        )
    given = [
        f"{stream}.{key}"
        for stream in STREAMS
        for key in FLOWS
        if isinstance(data.get(stream), Mapping) and key in data[stream]
    ]
    if given:
        raise CorampError(
            *(
                f"{origins.get(key, label)}: {key}: beside {what}, which already says how many "
                "come when; allowed is one of the two"
                for key in given
            )
        )


def _is_valid(part: Mapping[str, Any]) -> bool:
    begin_s, end_s = part.get("begin_s", 0.0), part.get("end_s")
    known = (value for key in ("vehicles", "flow_veh_h") if (value := part.get(key)) is not None)
    numbers = all(_is_number(value) for value in (begin_s, end_s, *known))
    return numbers and begin_s < end_s


def _vehicles_until(part: Mapping[str, Any], horizon_s: float) -> float:
    begin_s, end_s = part.get("begin_s", 0.0), part["end_s"]
    share = min(1.0, max(0.0, (horizon_s - begin_s) / (end_s - begin_s)))
    count = part.get("vehicles")
    if count is None:
        count = (part.get("flow_veh_h") or 0.0) * (end_s - begin_s) / 3600.0
    return float(share * count)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
