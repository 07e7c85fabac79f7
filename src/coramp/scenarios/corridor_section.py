"""The table ``[corridor]``: merge sites in a SUMO network one behind the other, their traffic."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Flow = Annotated[float, Field(ge=0.0)]


class ExitShare(BaseModel):
    """An exit: the edge by which ``share`` of the vehicles that pass it leave."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    edge: Annotated[str, Field(min_length=1)]
    share: Annotated[float, Field(ge=0.0, le=1.0)]


class CorridorSection(BaseModel):
    """Where the merge sites lie, in the order of driving, and how much traffic comes by each road.

    ``sites`` are on-ramps of the network in ``file``, whose hash is ``sha256``.
    ``mainline_flow_veh_h`` is the flow at the upstream end: a number, or one for each road where
    sites lie on several, such as both carriageways. ``ramp_flow_veh_h`` has one flow a site.
    A site's zone begins ``upstream_m`` before its nose, or at the junction before that, and ends
    ``downstream_m`` behind its acceleration lane.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    file: Annotated[str, Field(min_length=1)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    sites: Annotated[
        tuple[Annotated[str, Field(min_length=1)], ...], Field(min_length=1, strict=False)
    ]
    mainline_flow_veh_h: Flow | Annotated[tuple[Flow, ...], Field(strict=False)]
    ramp_flow_veh_h: Annotated[tuple[Flow, ...], Field(strict=False)]
    exits: Annotated[tuple[ExitShare, ...], Field(strict=False)] = ()
    upstream_m: Annotated[float, Field(ge=100.0, le=2000.0)] = 300.0
    downstream_m: Annotated[float, Field(ge=0.0, le=2000.0)] = 100.0

    def flows_of_roads(self, roads: int) -> tuple[float, ...]:
        """Returns the flow at the upstream end of each of so many roads."""
        given = self.mainline_flow_veh_h
        return given if isinstance(given, tuple) else (given,) * roads
