"""Writing a scenario of a corridor in a SUMO network."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from coramp.scenarios.corridors import corridor_of
from coramp.scenarios.network_section import sha256_of

EXIT_SHARE = 0.1
"""The share of vehicles that leave at each exit of a new corridor."""
HEAD = (
    "Sites stand in the order of driving; set the flows, the exits' shares and what else you need."
)


def new_corridor_text(
    name: str,
    network: Path,
    lies_in: str,
    ramp_ids: Sequence[str],
    flows_veh_h: tuple[float, float],
) -> str:
    """Returns the TOML text of a corridor's scenario, with flows of a mainline lane and of a ramp.

    ``network`` is read, and is to be where ``lies_in`` says. Raises CorampError where coramp cannot
    drive there.
    """
    section: dict[str, Any] = {
        "file": str(network.absolute()),
        "sha256": sha256_of(network),
        "sites": list(ramp_ids),
        "mainline_flow_veh_h": 0.0,
        "ramp_flow_veh_h": [flows_veh_h[1]] * len(ramp_ids),
    }
    whole = corridor_of({"name": name, "corridor": section}, str(network))
    lanes = [len(road.sites[0].mainline_edge.lanes) for road in whole.roads]
    flows = [flows_veh_h[0] * count for count in lanes]
    section["mainline_flow_veh_h"] = flows[0] if len(flows) == 1 else flows
    exits = [way.edge_id for road in whole.roads for way in road.exits]
    section["exits"] = [{"edge": edge_id, "share": EXIT_SHARE} for edge_id in exits]
    corridor_of({"name": name, "corridor": section}, name)
    section["file"] = lies_in
    return f"# {HEAD}\n{tomli_w.dumps({'name': name, 'corridor': section})}"
