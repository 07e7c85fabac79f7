"""Coordination of several ramp meters on a road: a ramp that fills up gets help from upstream.

Source: I. Papamichail, M. Papageorgiou, V. Vong, J. Gaffney, "Heuristic ramp-metering coordination
strategy implemented at Monash Freeway, Australia", Transp. Res. Record 2178, 2010 (HERO). Each
meter has ALINEA with control of its queue. One whose mainline is near its target and whose queue
has grown becomes a master; the next ramps upstream become its slaves, which build up queues that
fill their room as much as the master's does.

All here is pure: what was measured goes in, rates come out. Meters are given in driving direction,
the most upstream one first.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from coramp.strategies.alinea import SECONDS_AN_HOUR, Alinea
from coramp.strategies.metering import ALONE, MASTER, SLAVE, Update
from coramp.strategies.parameters import parameter


class Meter(NamedTuple):
    """What one meter measured in the last interval, and the rate (veh/h) that it had.

    Occupancy (%) is that of the mainline beside its ramp; vehicles arrive at the ramp at
    ``arrivals_veh_h``; of ``room_veh`` vehicles that the ramp holds ``queue_veh`` wait.
    """

    occupancy_percent: float
    rate_veh_h: float
    arrivals_veh_h: float
    queue_veh: float
    room_veh: float

    @property
    def share(self) -> float:
        """Which share of its room is taken."""
        return self.queue_veh / self.room_veh


class Cluster(NamedTuple):
    """A master and its slaves, by their places; slaves are the next ramps upstream of it."""

    master: int
    slaves: tuple[int, ...] = ()

    @property
    def members(self) -> tuple[int, ...]:
        """All of them, in driving direction."""
        return (*sorted(self.slaves), self.master)


@dataclass(frozen=True)
class Coordination:
    """How meters are coordinated; the first four are those of ALINEA.

    A meter becomes a master where the occupancy is above ``near_share`` of its target and its queue
    above ``begins_share`` of its room. It stops where the occupancy falls below ``far_share``, or
    the queue below ``ends_share``.
    """

    target_occupancy_percent: float = 20.0
    gain_veh_h: float = 70.0
    least_veh_h: float = 240.0
    most_veh_h: float = 1200.0
    update_s: float = 30.0
    near_share: float = 0.9
    far_share: float = 0.8
    begins_share: float = 0.3
    ends_share: float = 0.15

    def clusters(self, before: Sequence[Cluster], meters: Sequence[Meter]) -> tuple[Cluster, ...]:
        """Returns the clusters after an update, the most downstream one first.

        A cluster takes in one more ramp an update, while its ramps together are filled above
        ``begins_share``. A ramp belongs to one cluster at most; the master that stops lets its
        slaves go.
        """
        found = [c for c in before if not self._stops(meters[c.master])]
        taken = {place for cluster in found for place in cluster.members}
        for place in reversed(range(len(meters))):
            if place not in taken and self._begins(meters[place]):
                found.append(Cluster(place))
                taken.add(place)
        grown = []
        for cluster in sorted(found, key=lambda c: -c.master):
            upstream = min(cluster.members) - 1
            full = filled_share([meters[k] for k in cluster.members]) > self.begins_share
            if full and upstream >= 0 and upstream not in taken:
                cluster = Cluster(cluster.master, (*cluster.slaves, upstream))  # noqa: PLW2901
                taken.add(upstream)
            grown.append(cluster)
        return tuple(grown)

    def rates_veh_h(self, clusters: Sequence[Cluster], meters: Sequence[Meter]) -> list[float]:
        """Returns the rate (veh/h) of each meter until the next update."""
        least = {}
        for cluster in clusters:
            balanced = balanced_queues_veh([meters[place] for place in cluster.members])
            least.update(dict(zip(cluster.members, balanced, strict=True)))
        masters = {cluster.master for cluster in clusters}
        return [
            self._rate_veh_h(meter, None if place in masters else least.get(place))
            for place, meter in enumerate(meters)
        ]

    def towards_veh_h(self, meter: Meter, queue_veh: float) -> float:
        """Returns the rate (veh/h) with which the queue is so long at the next update.

        It is d - (w' - w) / T for arrivals d, a queue w and the update interval T; it may be below
        0, or more than the signal can let through.
        """
        missing_veh = queue_veh - meter.queue_veh
        return meter.arrivals_veh_h - missing_veh * SECONDS_AN_HOUR / self.update_s

    def _rate_veh_h(self, meter: Meter, least_veh: float | None) -> float:
        """ALINEA's rate; of a slave at most what builds its queue up, never less than room asks."""
        change = self.gain_veh_h * (self.target_occupancy_percent - meter.occupancy_percent)
        rate_veh_h = meter.rate_veh_h + change
        if least_veh is not None:
            rate_veh_h = min(rate_veh_h, self.towards_veh_h(meter, least_veh))
        rate_veh_h = max(rate_veh_h, self.towards_veh_h(meter, meter.room_veh))
        return min(self.most_veh_h, max(self.least_veh_h, rate_veh_h))

    def _begins(self, meter: Meter) -> bool:
        near = meter.occupancy_percent > self.near_share * self.target_occupancy_percent
        return near and meter.share > self.begins_share

    def _stops(self, meter: Meter) -> bool:
        far = meter.occupancy_percent < self.far_share * self.target_occupancy_percent
        return far or meter.share < self.ends_share


def filled_share(meters: Sequence[Meter]) -> float:
    """Returns which share of the room of all ramps together is taken."""
    return sum(m.queue_veh for m in meters) / sum(m.room_veh for m in meters)


def balanced_queues_veh(meters: Sequence[Meter]) -> list[float]:
    """Returns how many vehicles would wait at each meter if all were filled to the same share.

    Together they are as many as wait now.
    """
    share = filled_share(meters)
    return [share * meter.room_veh for meter in meters]


@dataclass(frozen=True)
class Hero(Alinea):
    """ALINEA at each ramp of a corridor; a ramp whose queue grows has those upstream hold back.

    It is for corridors with two ramps or more on a road, and is refused elsewhere.
    """

    name: ClassVar[str] = "hero"
    summary: ClassVar[str] = "ramp metering of a corridor, coordinated by HERO's rules"
    coordinates_meters: ClassVar[bool] = True

    near_percent: float = parameter(
        90.0, 1.0, 100.0, meaning="of o_target: above it a ramp can become a master"
    )
    far_percent: float = parameter(
        80.0, 0.0, 100.0, meaning="of o_target: below it a master lets its slaves go"
    )
    begins_percent: float = parameter(
        30.0, 1.0, 100.0, meaning="of the ramp's room: above it a queue makes a ramp a master"
    )
    ends_percent: float = parameter(
        15.0, 0.0, 100.0, meaning="of the ramp's room: below it a master lets its slaves go"
    )

    def problems(self) -> list[str]:
        """Returns what does not fit together: thresholds that end what they would begin."""
        found = super().problems()
        for begins, ends in (("near", "far"), ("begins", "ends")):
            most, least = getattr(self, f"{begins}_percent"), getattr(self, f"{ends}_percent")
            if least > most:
                found.append(
                    f"{ends}_percent: {least:g} is above {begins}_percent; allowed is up to "
                    f"{most:g}"
                )
        return found

    @property
    def coordination(self) -> Coordination:
        """How the meters are coordinated."""
        return Coordination(
            self.target_occupancy_percent,
            self.gain_veh_h,
            self.least_veh_h,
            self.most_veh_h,
            self.update_s,
            self.near_percent / 100.0,
            self.far_percent / 100.0,
            self.begins_percent / 100.0,
            self.ends_percent / 100.0,
        )

    def rates(
        self, measured: Sequence[Update], roads: Sequence[Sequence[int]], coordinated: Any
    ) -> tuple[list[Update], Any]:
        """Returns the updates with coordinated rates; clusters lie on one road each."""
        rule, found = self.coordination, list(measured)
        before = coordinated or tuple(() for _ in roads)
        after = []
        for road, was in zip(roads, before, strict=True):
            meters = [_meter(measured[place]) for place in road]
            clusters = rule.clusters(was, meters)
            rates = rule.rates_veh_h(clusters, meters)
            master = {k: cluster.master for cluster in clusters for k in cluster.members}
            for k, (place, rate) in enumerate(zip(road, rates, strict=True)):
                role = ALONE if k not in master else MASTER if master[k] == k else SLAVE
                found[place] = measured[place]._replace(
                    rate_veh_h=rate, role=role, master=road[master.get(k, k)]
                )
            after.append(clusters)
        return found, tuple(after)


def _meter(measured: Update) -> Meter:
    return Meter(
        measured.occupancy_percent,
        measured.rate_veh_h,
        measured.arrivals_veh_h,
        measured.queue_veh,
        measured.room_veh,
    )
