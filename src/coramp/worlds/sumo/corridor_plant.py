"""The vehicles of a corridor in one SUMO session: who is in which zone, and how they are driven."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.lanes import OUTERMOST, RAMP_LANE
from coramp.mixed.users import RoadUsers
from coramp.worlds.sumo.corridor_look import (
    Found,
    Placed,
    ZoneLanes,
    placed_of,
    zone_lanes_of,
    zone_limits_of,
)
from coramp.worlds.sumo.corridor_record import CorridorRecord
from coramp.worlds.sumo.corridor_road import CorridorRoad
from coramp.worlds.sumo.corridor_sites import SiteAnswer, SiteView
from coramp.worlds.sumo.mixed_lanes import LanedPlant
from coramp.worlds.sumo.mixed_plant import NO_SITE
from coramp.worlds.sumo.road_limits import RoadLimits
from coramp.worlds.sumo.road_users import tails

NEVER = -1


@dataclass
class ZoneUsers:
    """Who a site's coordinator is told of."""

    names: Sequence[str]
    view: SiteView


class Whole(NamedTuple):
    """All that the coordinators of a moment are told of, site by site."""

    names: list[str]
    users: RoadUsers
    lane: IntArray
    inside: BoolArray


@dataclass
class CorridorPlant(LanedPlant):
    """The vehicles in a SUMO session that drives a whole corridor.

    A vehicle is commanded in the zone of one site at a time. Where it leaves the zone it is handed
    over: SUMO drives it, at the gaps that automated vehicles keep, until it enters the next.
    Only those on the lanes of zones are looked at. Of all others, those that have left among them,
    some numbers each are kept, in arrays.
    """

    corridor: CorridorRoad | None = None
    record: CorridorRecord = field(default_factory=lambda: CorridorRecord(0, 1.0))
    commands: bool = True
    _zone_lanes: ZoneLanes = field(init=False)
    _zone_limits: RoadLimits = field(init=False)
    _whole: Whole = field(init=False)
    _held: dict[int, str] = field(default_factory=dict)
    _held_at: IntArray = field(init=False)
    _seen_at: IntArray = field(init=False)
    _looks: int = 0

    def __post_init__(self) -> None:
        """Nobody has been seen, or is held, in any zone."""
        super().__post_init__()
        assert self.corridor is not None
        sites, count = self.corridor.sites, len(self.able.automated)
        self._zone_lanes = zone_lanes_of(sites, self.corridor.lanes)
        self._zone_limits = zone_limits_of(sites)
        self._held_at, self._seen_at = np.full(count, NO_SITE), np.full(count, NEVER)

    @cached_property
    def _may_act_rarely(self) -> bool:
        """Nobody: between zones SUMO drives by what it has seen of lanes while vehicles acted."""
        return False

    def _step_on(self) -> None:
        self.session.step_on()

    def look(self, now_s: float) -> list[ZoneUsers]:
        """Returns who is in or just ahead of each zone, and takes back who has left one."""
        found = self._found()
        placed = placed_of(self._zone_lanes, self._zone_limits, found)
        station_m = self._stations_sent_to(found, placed)
        self._forget_who_is_new(found.number)
        speed_mps, accel_mps2 = self._measured(found.number, station_m, found.speed_mps)
        self._note(now_s, found, placed, speed_mps[placed.place])
        if self.commands:
            self._release(now_s, found, placed, speed_mps)
            self._receive(now_s, found, placed, speed_mps)
        return self._zone_users(now_s, found, placed, speed_mps, accel_mps2)

    def _found(self) -> Found:
        """Who is on the lanes of all zones, by number, so that their order is always the same."""
        assert self.corridor is not None
        names, count_on, position_m, speed_mps = self.session.on_lanes(self.corridor.lanes)
        number_of = self.able.number
        number = np.array([number_of[name] for name in names], np.int64)
        order = np.argsort(number)
        return Found(
            [names[i] for i in order.tolist()],
            number[order],
            np.repeat(np.arange(len(count_on)), count_on)[order],
            np.array(position_m, np.float64)[order],
            np.array(speed_mps, np.float64)[order],
        )

    def _stations_sent_to(self, found: Found, placed: Placed) -> FloatArray:
        """Stations of who is commanded, in its zone; others are nan, and were sent nowhere."""
        station_m = np.full(len(found.number), np.nan)
        held = self._held_at[found.number[placed.place]] == placed.site
        station_m[placed.place[held]] = placed.station_m[held]
        self._motion.sent_mps[found.number[np.isnan(station_m)]] = np.nan
        return station_m

    def _forget_who_is_new(self, number: IntArray) -> None:
        """Of who was not seen a period ago no acceleration is known."""
        new = number[self._seen_at[number] != self._looks]
        self._motion.was_mps[new], self._motion.accel_mps2[new] = np.nan, 0.0
        self._looks += 1
        self._seen_at[number] = self._looks

    def _note(self, now_s: float, found: Found, placed: Placed, speed_mps: FloatArray) -> None:
        """Notes who has left a zone, and who is in one."""
        inside, number = placed.inside, found.number[placed.place]
        site, number_inside = placed.site[inside], number[inside]
        for n, k in self.record.gone(site, number_inside):
            own = placed.of_site(k)
            there = placed.station_m[own][number[own] == n]
            beyond_m = float(there[0]) - self._zone_lanes.to_m[k] if len(there) else 0.0
            self.record.leave(now_s, k, n, beyond_m)
        self.record.look(
            now_s,
            site,
            number_inside,
            placed.lane[inside],
            speed_mps[inside],
            placed.beyond_start_m[inside],
        )

    def _release(self, now_s: float, found: Found, placed: Placed, speed_mps: FloatArray) -> None:
        """Leaves to SUMO who has left its zone."""
        held = np.fromiter(self._held, np.int64, len(self._held))
        for n in held[self.record.site_of(held) != self._held_at[held]].tolist():
            k, name = int(self._held_at[n]), self._held.pop(n)
            self._held_at[n] = NO_SITE
            self._forget_change(n)
            self._motion.sent_mps[n] = self._motion.sent_m[n] = np.nan
            if self._seen_at[n] != self._looks:
                self.session.release(name)  # beyond what is seen, or out of the network
                self.record.hand_over(now_s, n, k, False, (np.nan, np.nan, np.nan))
                continue
            self.session.release_here(name)
            i = int(np.searchsorted(found.number, n))
            entry = placed.entry_of(k, i)
            at = (np.nan, np.nan)
            if entry is not None:
                at = (float(placed.station_m[entry]), float(placed.lane[entry]))
            self.record.hand_over(now_s, n, k, False, (*at, float(speed_mps[i])))

    def _receive(self, now_s: float, found: Found, placed: Placed, speed_mps: FloatArray) -> None:
        """Notes who enters a zone, and is commanded from now on."""
        number = found.number[placed.place]
        enters = placed.inside & self.able.automated[number] & (self._held_at[number] == NO_SITE)
        for entry in np.flatnonzero(enters).tolist():
            i, n, k = int(placed.place[entry]), int(number[entry]), int(placed.site[entry])
            self._held[n] = found.names[i]
            self._held_at[n] = k
            self.actuators.begin(n)
            at = float(placed.station_m[entry]), float(placed.lane[entry])
            self.record.hand_over(now_s, n, k, True, (*at, float(speed_mps[i])))

    def _zone_users(
        self,
        now_s: float,
        found: Found,
        placed: Placed,
        speed_mps: FloatArray,
        accel_mps2: FloatArray,
    ) -> list[ZoneUsers]:
        """What each site's coordinator is told: parts of arrays of them all."""
        place, able = placed.place, self.able
        number = found.number[place]
        users = RoadUsers(
            number,
            placed.station_m,
            speed_mps[place],
            accel_mps2[place],
            able.length_m[number],
            placed.lane > RAMP_LANE,
            able.automated[number],
            np.minimum(able.cruise_mps[number], placed.allowed_mps),
            able.acceleration_mps2[number],
            able.power_wpkg[number],
            able.braking_mps2[number],
        )
        names = [found.names[i] for i in place.tolist()]
        self._whole = Whole(names, users, placed.lane, placed.inside)
        may_leave = placed.beside & (placed.lane == RAMP_LANE) & placed.inside
        ahead, tail = self.ahead(users), tails(users, placed.lane, placed.site, self._came_by)
        zones = []
        for k in range(len(placed.first) - 1):
            own = placed.of_site(k)
            view = SiteView(
                now_s,
                RoadUsers._make([column[own] for column in users]),
                placed.lane[own],
                placed.beside[own],
                may_leave[own],
                ahead._replace(way_m=ahead.way_m[own], speed_mps=ahead.speed_mps[own]),
                tail[own],
            )
            zones.append(ZoneUsers(names[own], view))
        return zones

    def obey(self, answers: Sequence[SiteAnswer]) -> None:
        """Has the automated vehicles of all zones do what their coordinators answer."""
        whole, inside = self._whole, self._whole.inside
        names = [whole.names[i] for i in np.flatnonzero(inside).tolist()]
        users = RoadUsers._make([column[inside] for column in whole.users])
        accel_mps2 = np.concatenate([answer.accel_mps2 for answer in answers])[inside]
        changes = np.concatenate([answer.changes for answer in answers])[inside]
        asks = np.concatenate([answer.asks for answer in answers])[inside]
        self.record.change(users.number[changes & (whole.lane[inside] >= OUTERMOST)].tolist())
        self.command(names, users, accel_mps2, changes, asks)
