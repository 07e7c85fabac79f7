"""A road of two lanes with two on-ramps and an exit between them, made by netconvert."""

import subprocess
from pathlib import Path

import pytest
import sumo

NODES = """<nodes>
  <node id="west" x="0" y="0"/> <node id="nose1" x="800" y="0"/> <node id="end1" x="960" y="0"/>
  <node id="fork" x="1500" y="0"/> <node id="nose2" x="2000" y="0"/>
  <node id="end2" x="2160" y="0"/>
  <node id="east" x="2900" y="0"/>
  <node id="south1" x="400" y="-90"/> <node id="south2" x="1620" y="-90"/>
  <node id="out" x="1850" y="-120"/>
</nodes>
"""
EDGES = """<edges>
  <edge id="a" from="west" to="nose1" numLanes="2" speed="27.78"/>
  <edge id="on1" from="south1" to="nose1" numLanes="1" speed="22.22"/>
  <edge id="merge1" from="nose1" to="end1" numLanes="3" speed="27.78"/>
  <edge id="b" from="end1" to="fork" numLanes="2" speed="27.78"/>
  <edge id="off" from="fork" to="out" numLanes="1" speed="22.22"/>
  <edge id="c" from="fork" to="nose2" numLanes="2" speed="27.78"/>
  <edge id="on2" from="south2" to="nose2" numLanes="1" speed="22.22"/>
  <edge id="merge2" from="nose2" to="end2" numLanes="3" speed="27.78"/>
  <edge id="d" from="end2" to="east" numLanes="2" speed="27.78"/>
</edges>
"""
CONNECTIONS = """<connections>
  <connection from="a" to="merge1" fromLane="0" toLane="1"/>
  <connection from="a" to="merge1" fromLane="1" toLane="2"/>
  <connection from="on1" to="merge1" fromLane="0" toLane="0"/>
  <connection from="merge1" to="b" fromLane="1" toLane="0"/>
  <connection from="merge1" to="b" fromLane="2" toLane="1"/>
  <connection from="b" to="c" fromLane="0" toLane="0"/>
  <connection from="b" to="c" fromLane="1" toLane="1"/>
  <connection from="b" to="off" fromLane="0" toLane="0"/>
  <connection from="c" to="merge2" fromLane="0" toLane="1"/>
  <connection from="c" to="merge2" fromLane="1" toLane="2"/>
  <connection from="on2" to="merge2" fromLane="0" toLane="0"/>
  <connection from="merge2" to="d" fromLane="1" toLane="0"/>
  <connection from="merge2" to="d" fromLane="2" toLane="1"/>
</connections>
"""


def built(folder, left_out=()):
    """Returns the file of the road in a folder, without lines that name what is left out."""
    for name, text in (("nod", NODES), ("edg", EDGES), ("con", CONNECTIONS)):
        lines = [line for line in text.splitlines() if not any(part in line for part in left_out)]
        (folder / f"road.{name}.xml").write_text("\n".join(lines))
    command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "--no-turnarounds"]
    for option, name in (("node", "nod"), ("edge", "edg"), ("connection", "con")):
        command += [f"--{option}-files", str(folder / f"road.{name}.xml")]
    command += ["--junctions.limit-turn-speed", "-1", "--output-file", str(folder / "road.net.xml")]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "road.net.xml"


@pytest.fixture(scope="session")
def network(tmp_path_factory):
    """The network's file."""
    return built(tmp_path_factory.mktemp("road"))


@pytest.fixture(scope="session")
def without_exit(tmp_path_factory):
    """The file of the same road without its exit."""
    return built(tmp_path_factory.mktemp("without"), ('"off"', '"out"'))


@pytest.fixture(scope="session")
def a10kw():
    """A motorway that comes with SUMO: one on-ramp on each carriageway."""
    return Path(sumo.SUMO_HOME) / "tools" / "game" / "A10KW" / "osm.net.xml"
