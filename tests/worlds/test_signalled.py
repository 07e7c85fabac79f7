"""A signal on a ramp of a network: the edge is cut in two, and nothing else changes."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import sumo

from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.worlds.sumo.signalled import StopLine, add_signal, signalled_network, split_line

A10KW = Path(sumo.SUMO_HOME) / "tools" / "game" / "A10KW" / "osm.net.xml"
LINE = StopLine("24498409", 30.0)


def test_a_line_is_cut_at_a_share_of_its_length():
    # 3 m, 4 m and 5 m: half of 12 m is 3 m into the second leg
    line = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (8.0, 4.0)]
    before, behind = split_line(line, 0.5)
    assert before == [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0)]
    assert behind == [(3.0, 3.0), (3.0, 4.0), (8.0, 4.0)]


@pytest.fixture(scope="module")
def roots():
    whole = ET.parse(A10KW).getroot()
    cut = ET.parse(A10KW).getroot()
    add_signal(cut, LINE)
    return whole, cut


def test_what_is_no_part_of_the_edge_stays_as_it_is(roots):
    whole, cut = ([ET.tostring(e) for e in root] for root in roots)
    changed = set(whole) - set(cut)
    assert len(changed) == 3  # the edge, and what leads into it, from outside and within a junction
    assert all(b"24498409" in element for element in changed)


def test_the_ramp_keeps_its_id_and_its_length():
    found = on_ramps(read_network(signalled_network(A10KW, "test", (LINE,))))
    whole = on_ramps(read_network(A10KW)).named("24498409@4054057")
    ramp = found.named("24498409@4054057")
    assert [edge.edge_id for edge in ramp.ramp.edges[-2:]] == [LINE.before, "24498409"]
    assert ramp.ramp_m == pytest.approx(whole.ramp_m, abs=0.001)
    assert ramp.ramp.edges[-1].length_m == pytest.approx(whole.ramp_edge.length_m - 30.0)


@pytest.mark.parametrize("position_m", [0.5, 179.5])
def test_a_stop_line_at_the_end_of_an_edge_is_refused(roots, position_m):
    with pytest.raises(CorampError, match=r"too near to an end of the edge; allowed is 1 to 179"):
        add_signal(ET.fromstring(ET.tostring(roots[0])), StopLine("24498409", position_m))
    with pytest.raises(CorampError, match="no such edge"):
        add_signal(roots[0], StopLine("none", 5.0))
