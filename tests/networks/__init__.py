"""Networks for tests: those that come with SUMO, and small ones that netconvert makes."""

import os
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import sumo

from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.worlds.sumo.network import sumo_binary

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"
HIGHWAY = GAMES / "highway" / "highway.net.xml"
A10KW = GAMES / "A10KW" / "osm.net.xml"
RAMP = GAMES / "ramp" / "ramp.net.xml"
SHIPPED = (HIGHWAY, A10KW, RAMP)

NODES = {
    "west": (-600, 0),
    "south": (-400, -80),
    "nose": (0, 0),
    "end": (200, 0),
    "exit": (500, -60),
    "east": (600, 0),
}
MAIN = 'from="west" to="nose" numLanes="1" speed="27.78"'
LINK = 'from="south" to="nose" numLanes="1" speed="22.22"'
MERGE = 'from="nose" to="end" numLanes="2" speed="27.78"'
DOWN = 'from="end" to="east" numLanes="1" speed="27.78"'
ROAD = {"main": MAIN, "link": LINK, "merge": MERGE, "down": DOWN}
"""One lane, and a link that joins it by an acceleration lane of some 200 m."""


def elements(tag, ends):
    return "".join(f'<{tag} id="{name}" {rest}/>\n' for name, rest in ends.items())


def made(
    folder, edges=None, nodes=None, kinds=None, options=(), connections="", lanes=None, more=""
):
    """Returns the file of a network in a folder, made of edges by name and places of nodes.

    ``kinds`` are types of nodes, ``lanes`` what stands inside an edge, ``more`` beside the edges.
    """
    edges = ROAD if edges is None else edges
    used = {word.split('"')[1] for rest in edges.values() for word in rest.split() if "=" in word}
    points = {
        name: f'x="{x}" y="{y}" type="{(kinds or {}).get(name, "priority")}"'
        for name, (x, y) in {**NODES, **(nodes or {})}.items()
        if name in used
    }
    inner = lanes or {}
    roads = "".join(
        f'<edge id="{name}" {rest}>{inner.get(name, "")}</edge>\n' for name, rest in edges.items()
    )
    target = folder / "made.net.xml"
    target.write_bytes(
        built(
            f"<nodes>{elements('node', points)}</nodes>",
            f"<edges>{roads}{more}</edges>",
            f"<connections>{connections}</connections>",
            tuple(options),
        )
    )
    return target


@cache
def built(nodes, edges, connections, options):
    """Returns what netconvert makes of the texts of three files."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "made.nod.xml").write_text(nodes, "utf-8")
        (folder / "made.edg.xml").write_text(edges, "utf-8")
        (folder / "made.con.xml").write_text(connections, "utf-8")
        command = [
            *(sumo_binary("netconvert"), "--no-turnarounds", "true", *options),
            *("--node-files", "made.nod.xml", "--edge-files", "made.edg.xml"),
            *("--connection-files", "made.con.xml", "--output-file", "made.net.xml"),
        ]
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, "SUMO_HOME": sumo.SUMO_HOME},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return (folder / "made.net.xml").read_bytes()


def found_in(file):
    return on_ramps(read_network(file))


def only_ramp(file):
    (ramp,) = found_in(file).ramps
    return ramp
