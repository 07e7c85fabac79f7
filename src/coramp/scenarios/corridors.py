"""Corridors: a scenario file with ``[corridor]``, as the scenario of each of its merge sites."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from coramp.errors import CorampError
from coramp.networks.graph import Network
from coramp.networks.net_file import read_network
from coramp.networks.ramps import OnRamp, on_ramps
from coramp.networks.roads import ThroughRoad, roads_of
from coramp.networks.steady import on_steady_mainline
from coramp.scenarios.corridor_section import CorridorSection
from coramp.scenarios.defaults import with_defaults, with_populations
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import changed_line, sha256_of
from coramp.scenarios.of_ramp import reason_against, scenario_data
from coramp.scenarios.toml_files import read, validated, with_overrides
from coramp.scenarios.world_sections import with_preset

TABLE = "corridor"
OF_SITES = ("mainline", "ramp", "network", "arrivals")
"""What a corridor takes from its network, or cannot have."""
LOOK_M = 100.0
"""So far beyond its zone a site sees vehicles ahead, as those that leave it do by themselves."""
FLOWS = {
    "mainline.flow_veh_h": f"{TABLE}.mainline_flow_veh_h",
    "ramp.flow_veh_h": f"{TABLE}.ramp_flow_veh_h",
}


class _Whole(BaseModel):
    """So that errors in the table name its keys as they stand in the file."""

    model_config = ConfigDict(extra="forbid", strict=True)

    corridor: CorridorSection


@dataclass(frozen=True)
class Zone:
    """Which part of the road a site's coordinator knows, in stations of the site.

    It commands vehicles from ``from_m`` on the mainline and ``ramp_from_m`` on the ramp to
    ``to_m``, and sees who is ahead up to ``sees_m``.
    """

    from_m: float
    ramp_from_m: float
    to_m: float
    sees_m: float


@dataclass(frozen=True)
class Corridor:
    """Merge sites in the order in which they are given, each with its scenario and its zone.

    ``scenarios`` hold what vehicles, drivers and the world are like, and the road at each site. The
    mainline's flow stands in the first site's of each road, and is 0 in the others'.
    """

    name: str
    section: CorridorSection
    roads: tuple[ThroughRoad, ...]
    scenarios: tuple[Scenario, ...]
    zones: tuple[Zone, ...]

    @property
    def sites(self) -> tuple[OnRamp, ...]:
        """The merge sites."""
        return tuple(site for road in self.roads for site in road.sites)

    @property
    def common(self) -> Scenario:
        """The scenario of the first site; what is no road or flow is the same in all."""
        return self.scenarios[0]

    @property
    def file(self) -> Path:
        """The network's file."""
        return Path(self.section.file)

    def as_data(self) -> dict[str, Any]:
        """Returns the whole of it as plain data."""
        common = self.common.model_dump(mode="json")
        rest = {key: value for key, value in common.items() if key not in OF_SITES}
        return {**rest, TABLE: self.section.model_dump(mode="json")}


def is_corridor(name: str) -> bool:
    """Returns whether a scenario's file has a table ``[corridor]``."""
    return TABLE in read("scenarios", name)[1]


def load_corridor(
    name: str, overrides: Mapping[str, Any] | None = None, origin: str = "--set"
) -> Corridor:
    """Returns the corridor of a scenario file, with dotted keys overridden.

    Raises CorampError with a line for what is wrong; ``origin`` is what overrides are blamed on,
    an empty one leaves it to the caller to tell.
    """
    label, data = read("scenarios", name)
    overrides = overrides or {}
    blamed = dict.fromkeys(overrides, origin)
    data = with_overrides(data, overrides, blamed)
    return corridor_of(data, label, blamed)


def corridor_of(
    data: Mapping[str, Any], label: str, blamed: Mapping[str, str] | None = None
) -> Corridor:
    """Returns the corridor of a scenario file's content; ``label`` is the file, for errors."""
    if given := [key for key in OF_SITES if key in data]:
        raise CorampError(
            f"{label}: {given[0]}: stands beside [corridor], whose network tells the roads and "
            "whose keys the flows; allowed is [corridor] alone"
        )
    blamed = blamed or {}
    section = validated(_Whole, {TABLE: data[TABLE]}, label, blamed).corridor
    path = str((Path(label).parent / section.file).absolute())
    section = section.model_copy(update={"file": path})
    try:
        roads = _roads(section)
        flows = _checked_flows(section, roads)
        scenarios = _scenarios(data, label, blamed, section, roads, flows)
        zones = tuple(_zone(section, site) for road in roads for site in road.sites)
        _check_apart(roads, zones)
    except CorampError as error:
        raise CorampError(*(_told(line, label, blamed) for line in error.messages)) from error
    return Corridor(scenarios[0].name, section, roads, scenarios, zones)


def on_network(corridor: Corridor, file: Path) -> Corridor:
    """Returns a corridor on another network that has the same sites, of the same lengths."""
    section = corridor.section.model_copy(update={"file": str(file), "sha256": sha256_of(file)})
    return replace(corridor, section=section, roads=_roads(section))


def _told(line: str, label: str, blamed: Mapping[str, str]) -> str:
    """A line that begins with its origin and names the corridor's own keys."""
    for key, own in FLOWS.items():
        line = line.replace(key, own)
    callers = (f"{key}:" for key, origin in blamed.items() if not origin)
    return line if line.startswith((label, "--set", *callers)) else f"{label}: {line}"


def _roads(section: CorridorSection) -> tuple[ThroughRoad, ...]:
    path = Path(section.file)
    found = sha256_of(path)
    if found != section.sha256:
        raise CorampError(f"{TABLE}.sha256: {changed_line(path, found)}")
    for ramp_id in section.sites:
        if section.sites.count(ramp_id) > 1:
            raise CorampError(f"{TABLE}.sites: {ramp_id} stands twice; allowed is each site once")
    network, ramps = _network(path, found)
    for way in section.exits:
        if [other.edge for other in section.exits].count(way.edge) > 1:
            raise CorampError(f"{TABLE}.exits: {way.edge} stands twice; allowed is each exit once")
    sites = []
    for ramp_id in section.sites:
        if ramp_id not in ramps:
            known = ", ".join(ramps) or "none: there is no on-ramp"
            raise CorampError(
                f"{TABLE}.sites: there is no on-ramp {ramp_id!r}; allowed are {known}"
            )
        site = on_steady_mainline(ramps[ramp_id])
        if reason := reason_against(site):
            raise CorampError(f"{TABLE}.sites: {ramp_id} cannot be coordinated: {reason}")
        sites.append(site)
    try:
        return roads_of(network, sites, [way.edge for way in section.exits])
    except CorampError as error:
        key = "exits" if "exit" in str(error) else "sites"
        raise CorampError(f"{TABLE}.{key}: {error}") from error


def network_of(corridor: Corridor) -> Network:
    """Returns the network of a corridor; raises CorampError where it cannot be read."""
    return _network(corridor.file, corridor.section.sha256)[0]


@cache
def _network(path: Path, _sha256: str) -> tuple[Network, dict[str, OnRamp]]:
    """Reads a network once in this process, as long as the file stays as it is."""
    network = read_network(path)
    return network, {ramp.ramp_id: ramp for ramp in on_ramps(network).ramps}


def _checked_flows(section: CorridorSection, roads: Sequence[ThroughRoad]) -> tuple[float, ...]:
    flows = section.flows_of_roads(len(roads))
    if len(flows) != len(roads):
        names = "; ".join(", ".join(site.ramp_id for site in road.sites) for road in roads)
        raise CorampError(
            f"{TABLE}.mainline_flow_veh_h: has {len(flows)} flows; the sites lie on {len(roads)} "
            f"roads ({names}); allowed is a number, or one flow a road"
        )
    if len(section.ramp_flow_veh_h) != len(section.sites):
        raise CorampError(
            f"{TABLE}.ramp_flow_veh_h: has {len(section.ramp_flow_veh_h)} flows for "
            f"{len(section.sites)} sites; allowed is one flow a site"
        )
    return flows


def _scenarios(
    data: Mapping[str, Any],
    label: str,
    blamed: Mapping[str, str],
    section: CorridorSection,
    roads: Sequence[ThroughRoad],
    flows: Sequence[float],
) -> tuple[Scenario, ...]:
    """The scenario of each site: the road that its network tells, and all that they share."""
    common = {key: value for key, value in data.items() if key != TABLE}
    common = with_preset(with_populations(common))
    found, ramp_flows = [], iter(section.ramp_flow_veh_h)
    for road, flow_veh_h in zip(roads, flows, strict=True):
        for site in road.sites:
            own = scenario_data(site)
            own["mainline"]["flow_veh_h"] = flow_veh_h if site is road.sites[0] else 0.0
            own["ramp"]["flow_veh_h"] = next(ramp_flows)
            network = {"file": section.file, "sha256": section.sha256, "ramp": site.ramp_id}
            own = with_defaults({**own, **common, "network": network}, label)
            found.append(validated(Scenario, own, label, blamed))
    return tuple(found)


def _zone(section: CorridorSection, site: OnRamp) -> Zone:
    """The zone of a site, which ends so early that it still sees who is ahead of whom it leaves."""
    lane_end_m, road_m = site.merging.lane_m or 0.0, site.downstream.length_m
    to_m = min(lane_end_m + section.downstream_m, road_m - LOOK_M)
    if to_m < lane_end_m:
        raise CorampError(
            f"{TABLE}.sites: {site.ramp_id}: its road goes on for {road_m - lane_end_m:.0f} m "
            "behind the acceleration lane before other traffic joins or leaves; allowed is "
            f"{LOOK_M:g} m or more"
        )
    return Zone(
        from_m=-min(section.upstream_m, site.mainline_m),
        ramp_from_m=-min(section.upstream_m, site.ramp_m),
        to_m=to_m,
        sees_m=to_m + LOOK_M,
    )


def _check_apart(roads: Sequence[ThroughRoad], zones: Sequence[Zone]) -> None:
    """Raises CorampError where a zone begins before the one upstream of it ends."""
    by_site = dict(zip((s.ramp_id for road in roads for s in road.sites), zones, strict=True))
    for road in roads:
        for k in range(1, len(road.sites)):
            before, site = road.sites[k - 1], road.sites[k]
            apart_m = road.nose_m(site) - road.nose_m(before)
            ends_m, begins_m = by_site[before.ramp_id].to_m, by_site[site.ramp_id].from_m
            if ends_m > apart_m + begins_m:
                raise CorampError(
                    f"{TABLE}.upstream_m: the zones of {before.ramp_id} and {site.ramp_id} overlap "
                    f"by {ends_m - apart_m - begins_m:.0f} m; allowed are upstream_m and "
                    "downstream_m that leave them apart"
                )
