"""The faults: what is changed where, and the runs and tests that are to show it."""

from typing import NamedTuple


class Edit(NamedTuple):
    """One piece of code that is changed: the file below ``src/coramp``, and its text."""

    path: str
    before: str
    after: str


class Fault(NamedTuple):
    """A fault: its name, its edits, the run that is driven with it, and tests that may see it."""

    name: str
    edits: tuple[Edit, ...]
    run: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()


BUSY = ("--mainline", "1800", "--ramp", "700", "--horizon", "60", "--seed", "3")
SLOTS = ("--strategy", "slots", *BUSY)
PLATOON = (
    "--strategy",
    "virtual-platoon",
    "--mainline",
    "1500",
    "--ramp",
    "500",
    "--horizon",
    "25",
)

FAULTS = (
    Fault(
        "exit times 700 m too early",
        (
            Edit(
                "coordination/book.py",
                "time_at_station(way, zone_end_m)",
                "time_at_station(way, zone_end_m - 700.0)",
            ),
        ),
        ("--mainline", "2400", "--ramp", "900", "--horizon", "90", "--seed", "3"),
    ),
    Fault(
        "plans take over 3 m ahead of where the vehicle is",
        (
            Edit(
                "motion/approach.py", "station_m, speed_mps, 0.0", "station_m + 3.0, speed_mps, 0.0"
            ),
        ),
        BUSY,
    ),
    Fault(
        "0.3 m added to each station that planners read",
        (
            Edit(
                "kinematics/trajectory.py",
                "    return station_m, speed_mps\n",
                "    return station_m + 0.3, speed_mps\n",
            ),
        ),
        BUSY,
    ),
)
