"""Figures 4 and 16, against numbers worked by hand."""

import pytest

from coramp.report.formula_figures import collision_figure, fuel_figure


def lines_of(axes):
    return {line.get_label(): dict(zip(*line.get_data(), strict=True)) for line in axes.get_lines()}


def test_collision_acceleration_is_5_dv_over_1_plus_10_to_the_p():
    figure = collision_figure()
    lines = lines_of(figure.axes[1])
    assert list(lines) == ["p = -3", "p = -1", "p = 0", "p = 0.5", "p = 1"]
    assert lines["p = 0"][100.0] == pytest.approx(250.0)
    assert lines["p = 0"][50.0] == pytest.approx(125.0)
    assert lines["p = 1"][100.0] == pytest.approx(500.0 / 11.0)
    assert lines["p = -3"][100.0] == pytest.approx(500.0 / 1.001)
    assert lines["p = -1"][0.0] == 0.0


def test_fuel_is_the_polynomial_of_table_3():
    lines = lines_of(fuel_figure().axes[1])
    assert len(lines) == 5
    assert lines["0 m/s²"][0.0] == pytest.approx(0.1569)
    assert lines["0 m/s²"][20.0] == pytest.approx(0.8283)
    assert lines["1 m/s²"][0.0] == pytest.approx(0.1569 + 0.07224)
    # at 20 m/s: 0.07224 + 0.09681 * 20 + 1.075e-3 * 400 = 2.43844 a m/s2
    assert lines["2 m/s²"][20.0] == pytest.approx(0.8283 + 2.0 * 2.43844)
    assert lines["5 m/s²"][20.0] == pytest.approx(0.8283 + 5.0 * 2.43844)


@pytest.mark.parametrize(
    ("draw", "across", "along", "what"),
    [
        (
            collision_figure,
            "speed difference |Δv| (m/s)",
            "collision acceleration of vehicle 1 (m/s²)",
            "acceleration (m/s²)",
        ),
        (fuel_figure, "speed (m/s)", "fuel rate (ml/s)", "fuel rate (ml/s)"),
    ],
)
def test_axes_have_units(draw, across, along, what):
    surface, cuts, bar = draw().axes
    assert surface.get_xlabel() == cuts.get_xlabel() == across
    assert cuts.get_ylabel() == along
    assert bar.get_ylabel() == what


@pytest.mark.parametrize(
    ("draw", "span", "height"),
    [(collision_figure, (0.0, 100.0), (-3.0, 3.0)), (fuel_figure, (0.0, 30.0), (0.0, 5.0))],
)
def test_ranges_are_the_papers(draw, span, height):
    surface, cuts, _ = draw().axes
    assert surface.get_xlim() == cuts.get_xlim() == span
    assert surface.get_ylim() == height


def test_the_surface_stands_the_right_way_up():
    """Every point of the line of 200 m/s2 satisfies Eq. 8."""
    figure = collision_figure()
    (lines,) = (c for c in figure.axes[0].collections if 200.0 in c.levels and len(c.levels) < 10)
    path = lines.get_paths()[list(lines.levels).index(200.0)]
    for speed_mps, p in path.vertices[::10]:
        assert 5.0 * speed_mps / (1.0 + 10.0**p) == pytest.approx(200.0, rel=0.01)
