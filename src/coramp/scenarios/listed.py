"""Arrivals that are listed, and demand over time: neither stands beside a flow."""

from collections.abc import Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.road.streams import STREAMS
from coramp.scenarios.sections import Simulation

FLOWS = ("flow_veh_h", "flow_to_veh_h")
LIST = "arrivals"


def lists_arrivals(data: Mapping[str, Any]) -> bool:
    """Returns whether the content of a scenario file lists its arrivals."""
    return bool(data.get(LIST))


def without_replaced_flows(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the data without its flows where a list is set in their place."""
    if not lists_arrivals(overrides):
        return dict(data)
    tables = {stream: data[stream] for stream in STREAMS if isinstance(data.get(stream), dict)}
    return {
        **data,
        **{
            stream: {key: value for key, value in table.items() if key not in FLOWS}
            for stream, table in tables.items()
        },
    }


def with_listed_flows(
    data: Mapping[str, Any], label: str, origins: Mapping[str, str]
) -> dict[str, Any]:
    """Returns the data with the flows (veh/h) that its list amounts to over the horizon.

    ``origins`` says who set a dotted key. Raises CorampError where a flow is given beside a list.
    """
    if not lists_arrivals(data):
        return dict(data)
    given = [
        f"{stream}.{key}"
        for stream in STREAMS
        for key in FLOWS
        if isinstance(data.get(stream), dict) and key in data[stream]
    ]
    if given:
        raise CorampError(*_beside_a_list(given, label, origins))
    flows = {stream: _flow_veh_h(data, stream) for stream in STREAMS}
    return {
        **data,
        **{
            stream: {**data[stream], "flow_veh_h": flow}
            for stream, flow in flows.items()
            if isinstance(data.get(stream), dict)
        },
    }


def _beside_a_list(given: list[str], label: str, origins: Mapping[str, str]) -> list[str]:
    """A line for each that set flows: the file, or options."""
    by_origin: dict[str, list[str]] = {}
    for key in given:
        by_origin.setdefault(origins.get(key, label), []).append(key)
    return [
        f"{f'{origin}: ' if origin else ''}{', '.join(keys)}: beside [[arrivals]], which already "
        "lists every vehicle; allowed is a list or flows, never both"
        for origin, keys in by_origin.items()
    ]


def _flow_veh_h(data: Mapping[str, Any], stream: str) -> float:
    """How many of a list come by a stream in an hour; 0 where the data is not valid."""
    simulation, listed = data.get("simulation", {}), data[LIST]
    horizon_s = simulation.get("horizon_s") if isinstance(simulation, dict) else None
    if horizon_s is None:
        horizon_s = Simulation().horizon_s
    if not isinstance(listed, list | tuple) or not isinstance(horizon_s, int | float):
        return 0.0
    count = sum(isinstance(a, Mapping) and a.get("stream") == stream for a in listed)
    return 3600.0 * count / horizon_s if horizon_s > 0.0 else 0.0
