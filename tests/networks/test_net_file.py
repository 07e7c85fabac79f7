"""Reading networks: as they are, packed, with other letters, and what is no network."""

import gzip

import pytest

from coramp.errors import CorampError
from coramp.networks.net_file import FORMAT, read_network
from coramp.networks.ramps import on_ramps
from tests.networks import HIGHWAY, ROAD, made, only_ramp


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return made(tmp_path_factory.mktemp("plain"))


def test_a_packed_network_is_read_as_the_plain_one(plain, tmp_path):
    packed = tmp_path / "made.net.xml.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert read_network(packed) == read_network(plain)


def test_who_wrote_it_in_which_format_is_read(plain):
    network = read_network(plain)
    assert network.version == FORMAT
    assert network.written_by.startswith("netconvert 1.28.0")
    old = read_network(HIGHWAY)
    assert (old.version, old.written_by) == ("1.16", "netedit v1_14_1+8770-d8469bdc8ac")


def test_names_of_any_letters_are_read(tmp_path):
    folder = tmp_path / "Straße ü"
    folder.mkdir()
    names = {"link": "Auffahrt-Süd", "merge": "合流"}
    edges = {names.get(name, name): rest for name, rest in ROAD.items()}
    assert only_ramp(made(folder, edges)).ramp_id == "Auffahrt-Süd@合流"


def test_a_network_without_lanes_inside_junctions_is_read(tmp_path):
    file = made(tmp_path, options=("--no-internal-links", "true"))
    ramp = only_ramp(file)
    assert ramp.ramp_way.inside == ()
    assert ramp.ramp_m == ramp.ramp_edge.length_m


def edited(file, folder, old, new):
    text = file.read_text("utf-8")
    assert old in text
    target = folder / "edited.net.xml"
    target.write_text(text.replace(old, new), "utf-8")
    return target


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty: "),
        (b"   \n", "is empty: "),
        (b"edge;lane\n1;2\n", "is cut off or no XML: line 1: "),
        (b"<routes/>", "holds <routes> and no network; "),
        (b"<net/>", "is no complete network: version is missing; "),
        (b'<net version="new"/>', "is no complete network: "),
        (b"\x1f\x8b\x08garbage", "is cut off or damaged "),
        (b"\xff\xfe<net/>", "is cut off or no XML: line 1: "),
    ],
)
def test_what_is_no_network_is_told_in_a_line(tmp_path, content, told):
    file = tmp_path / "a.net.xml"
    file.write_bytes(content)
    with pytest.raises(CorampError) as caught:
        read_network(file)
    (line,) = caught.value.messages
    assert line.startswith(f"{file}: {told}")
    assert "; allowed is a " in line
    assert "\n" not in line


def test_a_network_that_is_cut_off_is_told_with_the_line(plain, tmp_path):
    content = plain.read_bytes()
    file = tmp_path / "cut.net.xml"
    for share in (0.2, 0.5, 0.8, 0.99):
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(CorampError, match=r"cut\.net\.xml: is cut off or no XML: line \d+: "):
            read_network(file)
    packed = gzip.compress(content)
    for share in (0.1, 0.5, 0.99):
        file.write_bytes(packed[: int(share * len(packed))])
        with pytest.raises(CorampError, match="is cut off or damaged"):
            read_network(file)


def test_what_is_not_there_or_no_file_is_told(tmp_path):
    with pytest.raises(CorampError, match=r"none\.net\.xml: cannot be read: No such file.*; allow"):
        read_network(tmp_path / "none.net.xml")
    with pytest.raises(CorampError, match="cannot be read: Is a directory; allowed is a SUMO"):
        read_network(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('speed="22.22"', 'speed="nan"', "lane link_0 "),
        ('speed="22.22"', 'speed="-1"', "lane link_0 "),
        ('speed="22.22"', 'speed="fast"', "could not convert string to float: 'fast'"),
        ('length="389.79"', 'length="1e999"', "lane link_0 of inf m"),
        (' shape="0.00,78.40 582.50,78.40"', "", "lane main_0 without a shape of two points"),
        ('"0.00,78.40 582.50,78.40"', '"nan,78.40 582.50,78.40"', "lane main_0 without a shape"),
        ('encoding="UTF-8"', 'encoding="none"', "unknown encoding: none"),
        ('from="link" to="merge"', 'from="link" to="gone"', "gone is missing"),
        ('from="link" to="merge" fromLane="0"', 'from="link" to="merge" fromLane="3"', ""),
        ('from="link" to="merge"', 'from="link"', "to is missing"),
    ],
)
def test_a_network_with_a_value_that_cannot_be_is_told(plain, tmp_path, old, new, told):
    file = edited(plain, tmp_path, old, new)
    with pytest.raises(CorampError) as caught:
        read_network(file)
    (line,) = caught.value.messages
    assert line.startswith(f"{file}: is no complete network: {told}")
    assert line.endswith("; allowed is a SUMO network, .net.xml or .net.xml.gz")


def test_the_order_of_edges_in_the_file_does_not_matter(plain, tmp_path):
    text = plain.read_text("utf-8")
    begin, end = text.index('<edge id="down"'), text.index('<edge id="link"')
    moved = text[:begin] + text[end:].replace("<junction", text[begin:end] + "<junction", 1)
    file = tmp_path / "moved.net.xml"
    file.write_text(moved, "utf-8")
    assert moved != text
    assert on_ramps(read_network(file)) == on_ramps(read_network(plain))
