"""The growing list of requests to enter that a world offers the coordinator, in order of time."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.messages.events import RequestToEnter, columns_of
from coramp.vehicles.traits import LENGTH, Traits


class Requests(NamedTuple):
    """Requests as kernels read them; there may be more entries than the feed has requests.

    Of a vehicle that only the common limits bind, ``traits`` has the length, and nan for the rest.
    """

    step: IntArray
    on_ramp: BoolArray
    speed_mps: FloatArray
    traits: FloatArray
    lane: IntArray


class RequestFeed:
    """Belongs to the world. Whoever reads it reads no request before its step.

    A simulator that knows all requests beforehand offers all of them at once; a live service adds
    each as it comes (``append``), at any time before its step has been handled.
    """

    def __init__(self, requests: Iterable[RequestToEnter] = ()) -> None:
        self._list = list(requests)
        columns = columns_of(self._list)
        self.arrays = Requests(
            np.array(columns.step, np.int64),
            np.array(columns.on_ramp, np.bool_),
            np.array(columns.speed_mps, np.float64),
            _traits_rows(columns.length_m, columns.traits),
            np.array(columns.lane, np.int64),
        )
        if (np.diff(self.arrays.step) < 0).any():
            raise ValueError("requests must come in order of time")

    def __len__(self) -> int:
        return len(self._list)

    def __getitem__(self, number: int) -> RequestToEnter:
        return self._list[number]

    def append(self, request: RequestToEnter) -> None:
        """Offers one more request; raises ValueError where it cannot be."""
        numbers = (request.speed_mps, request.length_m)
        if not all(math.isfinite(number) and number > 0.0 for number in numbers):
            raise ValueError(f"{request.vehicle_id}: speed and length must be positive and finite")
        if request.step < (self._list[-1].step if self._list else 0):
            raise ValueError(f"{request.vehicle_id}: comes before the request before it")
        place = len(self._list)
        if place == len(self.arrays.step):
            self.arrays = Requests(*(_longer(column) for column in self.arrays))
        arrays = self.arrays
        arrays.step[place], arrays.on_ramp[place] = request.step, request.on_ramp
        arrays.speed_mps[place] = request.speed_mps
        arrays.traits[place] = _traits_rows([request.length_m], [request.traits])[0]
        arrays.lane[place] = request.lane
        self._list.append(request)


def _traits_rows(length_m: Sequence[float], traits: Sequence[Traits | None]) -> FloatArray:
    rows = np.full((len(length_m), len(Traits._fields)), math.nan)
    rows[:, LENGTH] = length_m
    for place, own in enumerate(traits):
        if own is not None:
            rows[place] = own
    return rows


def _longer(column: Any) -> Any:
    longer = np.zeros((2 * len(column) + 16, *column.shape[1:]), column.dtype)
    longer[: len(column)] = column
    return longer
