"""The growing list of requests to enter that a world offers the coordinator, in order of time."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.messages.events import RequestToEnter
from coramp.vehicles.traits import LENGTH, Traits


class Requests(NamedTuple):
    """Requests as kernels read them; there may be more entries than the feed has requests.

    Of a vehicle that only the common limits bind, ``traits`` has the length, and nan for the rest.
    """

    step: IntArray
    on_ramp: BoolArray
    speed_mps: FloatArray
    traits: FloatArray


class RequestFeed:
    """Belongs to the world. Whoever reads it reads no request before its step.

    A simulator that knows all requests beforehand offers all of them at once; a live service adds
    each as it comes (``append``), at any time before its step has been handled.
    """

    def __init__(self, requests: Iterable[RequestToEnter] = ()) -> None:
        self._list = list(requests)
        listed = self._list
        self.arrays = Requests(
            np.array([request.step for request in listed], np.int64),
            np.array([request.on_ramp for request in listed], np.bool_),
            np.array([request.speed_mps for request in listed], np.float64),
            _traits_rows(listed),
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
        arrays.traits[place] = _traits_rows([request])[0]
        self._list.append(request)


def _traits_rows(requests: Sequence[RequestToEnter]) -> FloatArray:
    rows = np.full((len(requests), len(Traits._fields)), math.nan)
    rows[:, LENGTH] = [request.length_m for request in requests]
    for place, request in enumerate(requests):
        if request.traits is not None:
            rows[place] = request.traits
    return rows


def _longer(column: Any) -> Any:
    longer = np.zeros((2 * len(column) + 16, *column.shape[1:]), column.dtype)
    longer[: len(column)] = column
    return longer
