"""The vehicles of a corridor in one SUMO session: who is in which zone, and how they are driven."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.lanes import OUTERMOST, RAMP_LANE
from coramp.mixed.users import RoadUsers
from coramp.worlds.sumo.corridor_record import CorridorRecord
from coramp.worlds.sumo.corridor_road import CorridorRoad, SiteRoad
from coramp.worlds.sumo.corridor_sites import SiteAnswer, SiteView
from coramp.worlds.sumo.mixed_lanes import NO_SITE, LanedPlant


class Found(NamedTuple):
    """Who is on the lanes of all zones, one entry each, by number."""

    names: list[str]
    lanes: list[str]
    number: IntArray
    position_m: FloatArray
    speed_mps: FloatArray


class Placed(NamedTuple):
    """Who of those found is on a site's lanes: their places among all, stations and lanes.

    ``inside`` is who is in the zone; the others are those ahead of it.
    """

    place: IntArray
    station_m: FloatArray
    lane: IntArray
    beside: BoolArray
    inside: BoolArray


@dataclass
class ZoneUsers:
    """Who a site's coordinator is told of, and who of them it commands."""

    names: list[str]
    view: SiteView
    inside: BoolArray


@dataclass
class CorridorPlant(LanedPlant):
    """The vehicles in a SUMO session that drives a whole corridor.

    A vehicle is commanded in the zone of one site at a time. Where it leaves the zone it is handed
    over: SUMO drives it, at the gaps that automated vehicles keep, until it enters the next.
    Only those on the lanes of zones are looked at.
    """

    corridor: CorridorRoad | None = None
    record: CorridorRecord = field(default_factory=lambda: CorridorRecord(0, 1.0))
    commands: bool = True
    _held: dict[int, tuple[str, int]] = field(default_factory=dict)
    _seen: set[int] = field(default_factory=set)

    @property
    def _sites(self) -> tuple[SiteRoad, ...]:
        assert self.corridor is not None
        return self.corridor.sites

    def look(self, now_s: float) -> list[ZoneUsers]:
        """Returns who is in or just ahead of each zone, and takes back who has left one."""
        found = self._found()
        placed = [_placed(own, found) for own in self._sites]
        site = np.full(len(found.number), NO_SITE)
        for k, own in enumerate(placed):
            site[own.place[own.inside]] = k
        station_m = self._stations_sent_to(found, placed)
        self._forget_who_is_new(found.number)
        speed_mps, accel_mps2 = self._measured(found.number, station_m, found.speed_mps.tolist())
        self._note(now_s, found, placed, speed_mps)
        self._hand_over(now_s, found, placed, site, speed_mps)
        return [
            self._zone_users(now_s, k, found, placed[k], speed_mps, accel_mps2)
            for k in range(len(placed))
        ]

    def _found(self) -> Found:
        """Who is on the lanes of all zones, by number, so that their order is always the same."""
        assert self.corridor is not None
        names, lanes, position_m, speed_mps = self.session.on_lanes(self.corridor.lanes)
        number = np.array([self.able.number[name] for name in names], np.int64)
        order = np.argsort(number)
        self._sumo_lane = {
            name: int(lane.rpartition("_")[2]) for name, lane in zip(names, lanes, strict=True)
        }
        return Found(
            [names[i] for i in order.tolist()],
            [lanes[i] for i in order.tolist()],
            number[order],
            np.array(position_m, np.float64)[order],
            np.array(speed_mps, np.float64)[order],
        )

    def _stations_sent_to(self, found: Found, placed: Sequence[Placed]) -> FloatArray:
        """Stations of who is commanded, in its zone; others are nan, and were sent nowhere."""
        held = np.array(
            [self._held.get(n, ("", NO_SITE))[1] for n in found.number.tolist()], np.int64
        )
        station_m = np.full(len(found.number), np.nan)
        for k, own in enumerate(placed):
            of_site = held[own.place] == k
            station_m[own.place[of_site]] = own.station_m[of_site]
        self._motion.sent_mps[found.number[np.isnan(station_m)]] = np.nan
        return station_m

    def _forget_who_is_new(self, number: IntArray) -> None:
        """Of who was not seen a period ago no acceleration is known."""
        here = set(number.tolist())
        new = np.array(sorted(here - self._seen), np.int64)
        self._motion.was_mps[new], self._motion.accel_mps2[new] = np.nan, 0.0
        self._seen = here

    def _note(
        self, now_s: float, found: Found, placed: Sequence[Placed], speed_mps: FloatArray
    ) -> None:
        """Notes who has left a zone, and who is in one."""
        for k, own in enumerate(placed):
            zone = self._sites[k].zone
            number = found.number[own.place]
            station_of = dict(zip(number.tolist(), own.station_m.tolist(), strict=True))
            still = set(number[own.inside].tolist())
            for n in sorted(self.record.inside(k) - still):
                self.record.leave(now_s, k, n, station_of.get(n, zone.to_m) - zone.to_m)
            lane = own.lane[own.inside]
            start_m = np.where(lane == RAMP_LANE, zone.ramp_from_m, zone.from_m)
            self.record.look(
                now_s,
                k,
                number[own.inside],
                lane,
                speed_mps[own.place[own.inside]],
                own.station_m[own.inside] - start_m,
            )

    def _hand_over(
        self,
        now_s: float,
        found: Found,
        placed: Sequence[Placed],
        site: IntArray,
        speed_mps: FloatArray,
    ) -> None:
        """Leaves to SUMO who has left its zone, and notes who enters one."""
        if not self.commands:
            return
        index = {n: i for i, n in enumerate(found.number.tolist())}
        for n, (name, k) in list(self._held.items()):
            i = index.get(n)
            if i is not None and site[i] == k:
                continue
            del self._held[n]
            self._forget_change(n)
            self._motion.sent_mps[n] = self._motion.sent_m[n] = np.nan
            if i is None:
                self.session.release(name)  # beyond what is seen, or out of the network
                self.record.hand_over(now_s, n, k, False, (np.nan, np.nan, np.nan))
                continue
            self.session.release_here(name)
            place = _place_in(placed[k], i)
            self.record.hand_over(now_s, n, k, False, (*place, float(speed_mps[i])))
        for k, own in enumerate(placed):
            for j in np.flatnonzero(own.inside).tolist():
                i = int(own.place[j])
                n = int(found.number[i])
                if self.able.automated[n] and n not in self._held:
                    self._held[n] = (found.names[i], k)
                    self.actuators.begin(n)
                    place = float(own.station_m[j]), float(own.lane[j])
                    self.record.hand_over(now_s, n, k, True, (*place, float(speed_mps[i])))

    def _zone_users(
        self,
        now_s: float,
        k: int,
        found: Found,
        own: Placed,
        speed_mps: FloatArray,
        accel_mps2: FloatArray,
    ) -> ZoneUsers:
        number, able = found.number[own.place], self.able
        allowed_mps = self._limits_at(self._sites[k], own)
        users = RoadUsers(
            number,
            own.station_m,
            speed_mps[own.place],
            accel_mps2[own.place],
            able.length_m[number],
            own.lane > RAMP_LANE,
            able.automated[number],
            np.minimum(able.cruise_mps[number], allowed_mps),
            able.acceleration_mps2[number],
            able.power_wpkg[number],
            able.braking_mps2[number],
        )
        may_leave = own.beside & (own.lane == RAMP_LANE) & own.inside
        tail = self._tails(users, own.lane, k)
        view = SiteView(now_s, users, own.lane, own.beside, may_leave, self.ahead(users), tail)
        return ZoneUsers([found.names[i] for i in own.place.tolist()], view, own.inside)

    def _limits_at(self, site: SiteRoad, own: Placed) -> FloatArray:
        """What the limits of each one's road let it drive."""
        return np.array(
            [
                site.limits(lane == RAMP_LANE).allowed_mps(at_m)
                for lane, at_m in zip(own.lane.tolist(), own.station_m.tolist(), strict=True)
            ],
            np.float64,
        )

    def obey(self, zones: Sequence[ZoneUsers], answers: Sequence[SiteAnswer]) -> None:
        """Has the automated vehicles of all zones do what their coordinators answer."""
        names: list[str] = []
        for zone in zones:
            names += [name for name, own in zip(zone.names, zone.inside, strict=True) if own]
        users = RoadUsers._make(
            np.concatenate(columns)
            for columns in zip(*(_inside_of(zone) for zone in zones), strict=True)
        )
        changes = np.concatenate(
            [answer.changes[zone.inside] for zone, answer in zip(zones, answers, strict=True)]
        )
        accel_mps2 = np.concatenate(
            [answer.accel_mps2[zone.inside] for zone, answer in zip(zones, answers, strict=True)]
        )
        lane = np.concatenate([zone.view.lane[zone.inside] for zone in zones])
        self.record.change(users.number[changes & (lane >= OUTERMOST)].tolist())
        self.command(names, users, accel_mps2, changes)


def _inside_of(zone: ZoneUsers) -> Iterator[FloatArray | IntArray | BoolArray]:
    return (column[zone.inside] for column in zone.view.users)


def _placed(site: SiteRoad, found: Found) -> Placed:
    """Who is on a site's lanes, in the zone or just ahead of it."""
    spans = site.lanes
    place = np.array([i for i, lane in enumerate(found.lanes) if lane in spans], np.int64)
    own = [spans[found.lanes[i]] for i in place.tolist()]
    start_m = np.array([span.start_m for span in own], np.float64)
    per_m = np.array([span.per_m for span in own], np.float64)
    station_m = start_m + found.position_m[place] * per_m
    lane = np.array([span.lane for span in own], np.int64)
    beside = np.array([span.changes for span in own], np.bool_)
    from_m = np.where(lane == RAMP_LANE, site.zone.ramp_from_m, site.zone.from_m)
    seen = (station_m >= from_m) & (station_m < site.zone.sees_m)
    inside = station_m < site.zone.to_m
    return Placed(place[seen], station_m[seen], lane[seen], beside[seen], inside[seen])


def _place_in(own: Placed, place: int) -> tuple[float, float]:
    """The station and lane of one of those found on a site's lanes; nan where it is not there."""
    there = np.flatnonzero(own.place == place)
    if len(there) == 0:
        return np.nan, np.nan
    return float(own.station_m[there[0]]), float(own.lane[there[0]])
