"""What the loop needs of a world that carries vehicles: a simulator, or a road.

The exact engine has none: what is committed is what is driven.
"""

from coramp.messages.channel import Plant
from coramp.messages.events import RequestToEnter

__all__ = ["Arrival", "Plant"]

Arrival = RequestToEnter
"""A vehicle on its way to the zone is known by the request with which it will come."""
