"""First in, first out, with the least control effort for everyone.

Source: J. Rios-Torres, A. A. Malikopoulos, "Automated and cooperative vehicle merging at highway
on-ramps", IEEE Trans. Intell. Transp. Syst. 18(4):780-789, 2017.
"""

from dataclasses import dataclass
from typing import ClassVar

from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.least_effort_planner import LeastEffort
from coramp.strategies.parameters import parameter
from coramp.strategies.sequence import Crossings, decide_in_sequence


@dataclass(frozen=True)
class FifoOptimalControl:
    """Vehicles merge in the order in which they would in free movement, with the least effort.

    The merge times follow one another: ``t_i = max(t_i free, t_(i-1) + h)`` with h from the safe
    distance. Each trajectory to its merge minimises ``1/2 int u^2 dt`` (``motion.least_effort``).
    Where it comes too near to another vehicle, that of the ladder's rungs in the same place is
    taken.
    """

    name: ClassVar[str] = "fifo-optimal-control"
    summary: ClassVar[str] = "first in, first out, on trajectories of least control effort"
    cooperative: ClassVar[bool] = True

    merge_station_m: float = parameter(
        120.0, 10.0, 5000.0, meaning="where ramp vehicles merge, at most the last merge station"
    )
    hold_s: float = parameter(0.5, 0.1, 5.0, meaning="time for which an acceleration is held")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for the first subject, behind everyone who would be before it."""
        planner = LeastEffort(self.merge_station_m, self.hold_s)
        return decide_in_sequence(vehicles_before, view, memory, planner, later_only=True)


def vehicles_before(seen: Crossings) -> int:
    """Returns how many lane vehicles cross before the subject would in free movement."""
    return int((seen.mainline_s <= seen.ramp_s[0]).sum())
