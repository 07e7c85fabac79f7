"""The paper's numbered equations as it prints them, each with what it gives.

The one place for their text: explanations, the docs and their tests read it here. What is computed
is in the functions of this package. Where the paper's form is a misprint, ``read_as`` says how it
is read, and docs/errata.md why. Speeds in Eq. 3, 15 and 16 are printed in km/h.
"""

from typing import NamedTuple


class PrintedEquation(NamedTuple):
    """A numbered equation of the paper; ``read_as`` is empty where it is read as printed."""

    gives: str
    printed: str
    read_as: str = ""


EQUATIONS: dict[int, PrintedEquation] = {
    1: PrintedEquation("safe distance, bumper to bumper", "L_safe = 2 L_1 + L_2 + L_3"),
    2: PrintedEquation("its part for the clock error", "L_2 = eps (v_1 + v_2)"),
    3: PrintedEquation(
        "its part for a faster follower",
        "L_3 = (v_1 - v_2)^2 / (254 (phi + varphi))",
        "v_1 is the follower's speed; nothing where it is the slower one",
    ),
    4: PrintedEquation("gap that a merging vehicle needs, by 1", "L_min s = L_v + 2 L_safe"),
    5: PrintedEquation("severity of a conflict", "J = a a_p"),
    6: PrintedEquation("collision acceleration from masses", "m_2 dv = (m_1 + m_2) a t"),
    7: PrintedEquation("the same from the ratio of masses", "a = |dv| / ((1 + k) t)"),
    8: PrintedEquation("the same from the logarithm of the ratio", "a = 5 |dv| / (1 + 10^p)"),
    9: PrintedEquation(
        "urgent acceleration, as printed and in its relative form",
        "a_p = (v_1^2 - v_2^2) / (2 S)",
    ),
    10: PrintedEquation("mainline vehicle", "S_main(t) = x_0 + v_0 t"),
    11: PrintedEquation("ramp vehicle before the nose", "S_1(t) = r + v_R0 t"),
    12: PrintedEquation(
        "ramp vehicle on the acceleration lane",
        "S_2(t) = S_1(t_1) + v_R0 (t - t_1) + a_r (t - t_1)^2 / 2",
    ),
    13: PrintedEquation(
        "ramp vehicle on the mainline", "S_3(t) = S_2(t_1 + t_2) + v_0 (t - t_1 - t_2)"
    ),
    14: PrintedEquation(
        "ramp vehicle, whichever of 11 to 13 holds", "S_R(t) = S_1(t), S_2(t) or S_3(t)"
    ),
    15: PrintedEquation(
        "distance to the vehicle in front at the lane change",
        "L_r-X = 2 L_1 + (v_Rx - v_X)^2 / (254 (phi + varphi))",
    ),
    16: PrintedEquation(
        "distance to the vehicle behind at the lane change",
        "L_r-Y = 2 L_1 + (v_Rx - v_Y)^2 / (254 (phi + varphi))",
    ),
    17: PrintedEquation("gap that the lane change needs", "L_min s = L_v + L_r-X + L_r-Y"),
    18: PrintedEquation(
        "merge station of free movement", "S_R(t_1 + t_2) = v_R0 t_2 + a_r t_2^2 / 2"
    ),
    19: PrintedEquation(
        "mainline vehicle at that merge", "S_main(t_1 + t_2) = x_0 + v_0 (t_1 + t_2)"
    ),
    20: PrintedEquation(
        "whether they conflict, and which of many does",
        "|S_R(t_1 + t_2) - S_main(t_1 + t_2)| <= L_v + 0.04",
    ),
    21: PrintedEquation(
        "least acceleration that reaches the mainline's speed on the lane",
        "a_r = (v_0^2 - v_R0^2) / (2 S_a)",
        "S_a ends one step before the lane does",
    ),
    22: PrintedEquation("accelerations that are allowed", "(v_0^2 - v_R0^2) / (2 S_a) <= a_r <= 6"),
    23: PrintedEquation("merge stations that are allowed", "0 < S_R(t_1 + t_2) < S_a"),
    24: PrintedEquation("time to the nose", "t_1 = |r| / v_R0"),
    25: PrintedEquation("time on the acceleration lane", "t_2 = (v_0 - v_R0) / a_r"),
    26: PrintedEquation("the same with another acceleration", "t_2' = (v_0 - v_R0) / a_r'"),
    27: PrintedEquation(
        "vehicle in front of the gap at the merge",
        "S_X(t_1 + t_2) = x + v_0 (t_1 + t_2)",
        "t_2' for t_2",
    ),
    28: PrintedEquation(
        "merge station",
        "S_R'(t_1 + t_2) = (v_0^2 - v_R0^2) / (2 a_r')",
        "t_2' for t_2",
    ),
    29: PrintedEquation(
        "ramp vehicle right behind the one in front",
        "S_X(t_1 + t_2) - L_v - L_r-X = S_R'(t_1 + t_2)",
        "t_2' for t_2",
    ),
    30: PrintedEquation(
        "acceleration that puts it there; as an interval, those that end within the gap",
        "a_r' = -(v_0 - v_R0)^2 / (2 (x + v_0 |r| / v_R0 - L_v - L_r-X))",
    ),
    31: PrintedEquation(
        "ramp vehicle with that acceleration",
        "S_R'(t) = S_1(t), S_2'(t) or S_2'(t_1 + t_2) + v_0 (t - t_1 - t_2)",
        "t_2' for t_2 in the third",
    ),
    32: PrintedEquation("22 for that acceleration", "(v_0^2 - v_R0^2) / (2 S_a) <= a_r' <= 6"),
    33: PrintedEquation(
        "23 for that acceleration", "0 < S_R(t_1 + t_2) < S_a", "t_2' for t_2, a_r' for a_r"
    ),
    34: PrintedEquation(
        "vehicle in front of the gap when the ramp vehicle is at the nose",
        "S_X(t_1) = x + v_0 |r| / v_R0",
    ),
    35: PrintedEquation("vehicle behind the gap at that time", "S_Y(t_1) = y + v_0 |r| / v_R0"),
    36: PrintedEquation("by how far the gap is too short", "dL_X = L_min s - L"),
    37: PrintedEquation(
        "acceleration of the ramp vehicle into the gap made", "a_r' = (v_0 - v_R0) / t_2'"
    ),
    38: PrintedEquation("its merge station", "S_mr' = (v_0 + v_R0) t_2' / 2"),
    39: PrintedEquation(
        "where the vehicle in front must be when the ramp vehicle is at the nose; 34, 38 and 39 "
        "solved for the time",
        "S_X = S_mr' + L_v + L_r-X - (v_0 t_2' + dL_X)",
        "S_X is X's station at t_1",
    ),
    40: PrintedEquation("way of a vehicle that makes a gap", "S_X = v_0 t_2' + dL_X"),
    41: PrintedEquation("half of it", "S_X / 2 = v_0 t_2' / 2 + a_Xacc (t_2' / 2)^2 / 2"),
    42: PrintedEquation("acceleration of the first half", "a_Xacc = 4 dL_X / t_2'^2"),
    43: PrintedEquation("acceleration of the second half", "a_Xdec = -4 dL_X / t_2'^2"),
    44: PrintedEquation("time of each half", "t_Xacc = t_Xdec = t_2' / 2"),
    45: PrintedEquation(
        "speed half-way; with 42, the largest shift within the bounds", "v_t = v_0 + a_Xacc t_Xacc"
    ),
    46: PrintedEquation("improvement rate of mainline priority", "I_r = 1 - D_m / D_k"),
    47: PrintedEquation("improvement rate of ramp priority", "I_p = 1 - D_r / D_k"),
    48: PrintedEquation(
        "fuel rate",
        "f = 0.1596 + 0.0245 v - 7.145e-4 v^2 + 5.975e-5 v^3 "
        "+ a (0.07224 + 0.09681 v + 1.075e-3 v^2)",
        "0.1569 for 0.1596, 7.415e-4 for 7.145e-4, as in Table 3",
    ),
}
"""By number."""


def in_words(number: int) -> str:
    """Returns an equation as printed, and how it is read where that is not the same."""
    equation = EQUATIONS[number]
    return (
        f"{equation.printed} (read: {equation.read_as})" if equation.read_as else equation.printed
    )
