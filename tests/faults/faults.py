"""The faults: what is changed where, and the run that is driven with each."""

from tests.faults.fault import Edit, Fault
from tests.faults.mixed_faults import MIXED_FAULTS

EXACT = ("paper", "--engine", "exact")
BUSY = (*EXACT, "--mainline", "2000", "--ramp", "900", "--horizon", "90", "--seed", "3")
STEERED = (
    *(*EXACT, "-s", "virtual-platoon", "--mainline", "1500", "--ramp", "500"),
    *("--horizon", "40"),
)
DELAYED = (
    *(*EXACT, "--mainline", "900", "--ramp", "2500", "--horizon", "120", "--seed", "2"),
    *("--set", "control.actuation_delay_s=3.0", "--set", "ramp.entry_speed_mps=[1.0, 12.0]"),
)

BOOK, TRAJECTORY = "coordination/book.py", "kinematics/trajectory.py"
SEPARATIONS = "metrics/separations.py"
SAFETY_FIGURES = "metrics/safety_figures.py"
START_BY_THE_COMMAND = Edit(
    "checker/checker.py",
    "_examine_start(pieces, earliest_s, pieces[0, 0], station_m, speed_mps)",
    "_examine_start(pieces, earliest_s, pieces[0, 0], pieces[0, 1], pieces[0, 2])",
)
AHEAD = Edit(
    TRAJECTORY,
    "    out[0, STATION] = station_m\n",
    "    out[0, STATION] = station_m + 3.0\n",
)
HELD_AHEAD = Edit(
    "motion/driving.py",
    "    n = begin(out, from_s, station_m, speed_mps)\n    return drive_within_limit",
    "    n = begin(out, from_s, station_m + 0.2, speed_mps)\n    return drive_within_limit",
)

FAULTS = (
    Fault(
        "exit times 700 m too early",
        (
            Edit(
                BOOK,
                "book.exit_s[row] = time_at_station(way, zone_end_m)",
                "book.exit_s[row] = time_at_station(way, zone_end_m - 700.0)",
            ),
        ),
        BUSY,
    ),
    Fault("plans begin 3 m ahead of where the vehicle is", (AHEAD,), BUSY),
    Fault(
        "0.3 m added to each station that planners read",
        (
            Edit(
                TRAJECTORY,
                "return pieces[k, STATION] + 0.5 * (pieces[k, SPEED] + speed_mps) * x",
                "return pieces[k, STATION] + 0.3 + 0.5 * (pieces[k, SPEED] + speed_mps) * x",
            ),
        ),
        BUSY,
    ),
    Fault(
        "plans begin 3 m ahead, and the checker takes the start from the command itself",
        (START_BY_THE_COMMAND, AHEAD),
        BUSY,
    ),
    Fault(
        "steered vehicles jump 0.2 m, and the checker takes the start from the command itself",
        (START_BY_THE_COMMAND, HELD_AHEAD),
        STEERED,
    ),
    Fault(
        "plans 5 mm too near, and violations count only below -0.01 m",
        (
            Edit(SEPARATIONS, "EXACT_M = 1e-8", "EXACT_M = 0.01"),
            Edit(
                "scenarios/model.py",
                "SafetyBudget(**self.safety.model_dump())",
                'SafetyBudget(**{**self.safety.model_dump(), "execution_allowance_m": -0.005})',
            ),
        ),
        BUSY,
    ),
    Fault(
        "extremes of TTC and DRAC within pieces are left out",
        (Edit(SEPARATIONS, "if opening_mps2 > 0.0:", "if opening_mps2 > 1e9:"),),
        STEERED,
        "tests/metrics/test_separations.py::test_the_smallest_ttc_may_lie_within_a_piece",
    ),
    Fault(
        "ramp vehicles count on the mainline 0.5 s late",
        (
            Edit(
                "records/lanes.py",
                "np.where(on_ramp, merge_s, entry_s)",
                "np.where(on_ramp, merge_s + 0.5, entry_s)",
            ),
        ),
        STEERED,
    ),
    Fault(
        "planners and checker both take half of the positioning error in Eq. 1",
        (
            Edit(
                "checker/distances.py",
                "by_paper_m = needs.errors_m + clock_m",
                "by_paper_m = 0.5 * needs.errors_m + clock_m",
            ),
            Edit(
                "equations/safe_distance.py",
                "        2.0 * safety.positioning_error_m\n",
                "        1.0 * safety.positioning_error_m\n",
            ),
        ),
        (*BUSY, "--set", "safety.positioning_error_m=0.5"),
    ),
    Fault(
        "newcomers reckon with commitments that act only after the delay",
        (
            Edit(
                BOOK,
                "return _as_fleet(book, book.way_first, book.way_count)",
                "return fleet_of(book)",
            ),
        ),
        DELAYED,
    ),
    Fault(
        "the row says half of the largest severity",
        (
            Edit(
                "metrics/safety_figures.py",
                '"max_severity": float(',
                '"max_severity": 0.5 * float(',
            ),
        ),
        BUSY,
    ),
    *MIXED_FAULTS,
)
