"""Scenarios of corridors for tests."""

import hashlib
from pathlib import Path

import tomli_w

SITES = ("on1@merge1", "on2@merge2")

FLOWS = {"mainline_flow_veh_h": 2800.0, "ramp_flow_veh_h": [600.0, 500.0]}
EXITS = [{"edge": "off", "share": 0.2}]


def section_of(network, **keys):
    """Returns the table [corridor] of both sites of the road that tests make."""
    found = hashlib.sha256(Path(network).read_bytes()).hexdigest()
    given = {"file": str(network), "sha256": found, "sites": list(SITES), "exits": EXITS}
    return {**given, **FLOWS, **keys}


def written(folder, network, automated=0.5, horizon_s=90.0, tables=None, **keys):
    """Returns a corridor's scenario file."""
    path = folder / "road.toml"
    content = {
        "traffic": {"automated_share": automated},
        "simulation": {"horizon_s": horizon_s, "drain_s": 600.0},
        **(tables or {}),
        "corridor": section_of(network, **keys),
    }
    path.write_text(tomli_w.dumps(content))
    return str(path)
