"""The figures that the paper prints in its Tables 1, 2 and 4, to stand beside ours."""

from typing import NamedTuple


class Printed(NamedTuple):
    """One cell of a table: without control, mainline priority, ramp priority."""

    uncontrolled: float
    mainline_priority: float
    ramp_priority: float


Flows = tuple[int, int]

MAINLINE_DELAY_S: dict[Flows, Printed] = {
    (800, 200): Printed(4.44, 0.23, 0.61),
    (800, 300): Printed(5.01, 0.38, 1.10),
    (800, 500): Printed(5.99, 0.45, 0.97),
    (1200, 200): Printed(7.60, 0.26, 0.54),
    (1200, 300): Printed(8.55, 0.57, 1.19),
    (1200, 500): Printed(9.45, 0.54, 1.31),
    (1800, 200): Printed(15.28, 0.54, 0.73),
    (1800, 300): Printed(18.04, 0.65, 1.24),
    (1800, 500): Printed(26.98, 0.68, 1.35),
}
"""Table 1."""

RAMP_DELAY_S: dict[Flows, Printed] = {
    (800, 200): Printed(7.35, 0.15, 0.46),
    (800, 300): Printed(8.62, 0.31, 0.43),
    (800, 500): Printed(9.65, 0.33, 0.37),
    (1200, 200): Printed(8.54, 0.18, 0.45),
    (1200, 300): Printed(9.66, 0.34, 0.44),
    (1200, 500): Printed(12.29, 0.44, 0.67),
    (1800, 200): Printed(11.47, 0.55, 0.71),
    (1800, 300): Printed(16.43, 0.66, 0.86),
    (1800, 500): Printed(20.42, 0.59, 0.85),
}
"""Table 2."""

FUEL_L: dict[Flows, Printed] = {
    (800, 200): Printed(15.18, 15.04, 15.13),
    (800, 300): Printed(16.93, 16.47, 16.30),
    (800, 500): Printed(19.65, 18.91, 19.17),
    (1200, 200): Printed(20.93, 20.62, 20.59),
    (1200, 300): Printed(22.36, 21.77, 21.48),
    (1200, 500): Printed(25.02, 24.27, 23.80),
    (1800, 200): Printed(28.56, 28.49, 27.49),
    (1800, 300): Printed(29.91, 29.64, 28.86),
    (1800, 500): Printed(34.76, 32.67, 32.95),
}
"""Table 4."""
