"""What formulas say by themselves: collision acceleration (Fig. 4) and fuel (Fig. 16)."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp._kernel import FloatArray
from coramp.equations.conflict_risk import collision_acceleration_of_log_ratio_mps2
from coramp.kinematics.fuel import fuel_rate_mlps
from coramp.report.style import COLOURS, LINES, grid, new_figure

COLLISION_LOG_RATIOS = (-3.0, -1.0, 0.0, 0.5, 1.0)
FUEL_ACCELS_MPS2 = (0.0, 1.0, 2.0, 3.0, 5.0)
POINTS = 121
SHADES = 22


def collision_figure() -> Figure:
    """Returns collision acceleration over speed difference and mass ratio (Eq. 8, Fig. 4).

    Speed differences are 0 to 100 m/s, p = lg(m_1 / m_2) is -3 to 3.
    """
    figure = new_figure(8.6, 3.7)
    surface, cuts = figure.subplots(1, 2)
    speeds_mps, ratios = np.linspace(0.0, 100.0, POINTS), np.linspace(-3.0, 3.0, POINTS)
    levels = (10.0, 50.0, 100.0, 200.0, 300.0, 400.0)
    values = _over(collision_acceleration_of_log_ratio_mps2, speeds_mps, ratios)
    _draw_surface(figure, surface, (speeds_mps, ratios, values), levels, "acceleration (m/s²)")
    surface.set(xlabel="speed difference |Δv| (m/s)", ylabel="p = lg(m₁ / m₂) (no unit)")
    _draw_cuts(
        cuts,
        speeds_mps,
        [(f"p = {p:g}", p) for p in COLLISION_LOG_RATIOS],
        collision_acceleration_of_log_ratio_mps2,
    )
    cuts.set(
        xlabel="speed difference |Δv| (m/s)", ylabel="collision acceleration of vehicle 1 (m/s²)"
    )
    cuts.legend()
    return figure


def fuel_figure() -> Figure:
    """Returns the fuel rate over speed and acceleration (Eq. 48 with Table 3, Fig. 16).

    Speeds are 0 to 30 m/s, accelerations 0 to 5 m/s2.
    """
    figure = new_figure(8.6, 3.7)
    surface, cuts = figure.subplots(1, 2)
    speeds_mps, accels_mps2 = np.linspace(0.0, 30.0, POINTS), np.linspace(0.0, 5.0, POINTS)
    values = _over(fuel_rate_mlps, speeds_mps, accels_mps2)
    levels = (1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0)
    _draw_surface(figure, surface, (speeds_mps, accels_mps2, values), levels, "fuel rate (ml/s)")
    surface.set(xlabel="speed (m/s)", ylabel="acceleration (m/s²)")
    _draw_cuts(cuts, speeds_mps, [(f"{a:g} m/s²", a) for a in FUEL_ACCELS_MPS2], fuel_rate_mlps)
    cuts.set(xlabel="speed (m/s)", ylabel="fuel rate (ml/s)", ylim=(0.0, None))
    cuts.legend(title="acceleration")
    return figure


def _over(
    function: Callable[[float, float], float], across: FloatArray, along: FloatArray
) -> FloatArray:
    """The values of a function, one row each of ``along``."""
    return np.array([[function(x, y) for x in across] for y in along])


def _draw_surface(
    figure: Figure,
    axes: Axes,
    surface: tuple[FloatArray, FloatArray, FloatArray],
    levels: Sequence[float],
    what: str,
) -> None:
    filled = axes.contourf(*surface, levels=SHADES, cmap="cividis")
    figure.colorbar(filled, ax=axes, label=what)
    lines = axes.contour(*surface, levels=levels, colors="white", linewidths=0.9)
    axes.clabel(lines, fmt="%g", fontsize=7.5)


def _draw_cuts(
    axes: Axes,
    across: FloatArray,
    cuts: Sequence[tuple[str, float]],
    function: Callable[[float, float], float],
) -> None:
    for k, (label, value) in enumerate(cuts):
        rates = [function(x, value) for x in across]
        axes.plot(across, rates, color=COLOURS[k], linestyle=LINES[k % len(LINES)], label=label)
    axes.set_xlim(across[0], across[-1])
    grid(axes)
