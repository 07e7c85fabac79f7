"""One look for all figures: colours, markers and lines per strategy, sizes, and how files look.

Colours are the Okabe-Ito palette, which colour-blind readers can tell apart; markers and lines
differ as well, so that a print in grey can be read.
"""

import io
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Figure  # noqa: PLC0414 - the API's annotations name it
from matplotlib.figure import SubFigure

from coramp.errors import CorampError
from coramp.records.files import write_bytes

BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
SKY, ORANGE, BLACK, GREY, YELLOW = "#56b4e9", "#e69f00", "#000000", "#7f7f7f", "#f0e442"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, BLACK, GREY)
MARKERS = "osD^vPX*"
LINES = ("-", "--", "-.", ":")
HATCHES = ("", "///", "...", "\\\\\\", "xx")
DPI = 110
UNDATED = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""What each kind of file must not say, so that the same figure gives the same bytes."""
RC: dict[str, float | str] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.5,
    "lines.markersize": 5.0,
    "errorbar.capsize": 2.5,
    "hatch.linewidth": 0.6,
    "svg.fonttype": "none",
    "svg.hashsalt": "coramp",
}


@dataclass(frozen=True)
class Look:
    """How one strategy is drawn, and what it is called.

    Mainline priority is wide, so that it can be seen where another line lies on it.
    """

    label: str
    colour: str
    marker: str
    line: str
    width_pt: float = 1.5


UNCONTROLLED = {
    "paper": Look("no control, paper's drivers", VERMILION, "s", "--"),
    "fair": Look("no control, fair drivers", ORANGE, "D", "-."),
    "paper-sigma0": Look("no control, paper's drivers, no noise", VERMILION, "v", "--"),
    "fair-sigma0": Look("no control, fair drivers, no noise", ORANGE, "P", "-."),
    "credible": Look("no control, credible drivers", BLACK, "X", "--"),
    "credible-uniform": Look("no control, credible drivers, all alike", GREY, "X", "-."),
    "automated-0.6": Look("no control, automated at 0.6 s", SKY, "<", ":"),
    "automated-0.8": Look("no control, automated at 0.8 s", GREEN, "<", ":"),
    "automated-1.0": Look("no control, automated at 1.0 s", PURPLE, "<", ":"),
}
COOPERATIVE = {
    "mainline-priority": Look("mainline priority", BLUE, "o", "-", 2.8),
    "ramp-priority": Look("ramp priority", PURPLE, "^", ":"),
    "fifo-optimal-control": Look("FIFO optimal control", GREEN, "v", "--"),
    "dp-sequence": Look("DP sequence", SKY, "P", "-."),
    "milp-sequence": Look("MILP sequence", VERMILION, "X", ":"),
    "game": Look("game", PURPLE, "p", "--"),
    "virtual-platoon": Look("virtual platoon", BLACK, "s", "-."),
    "ocbf": Look("OCBF", GREY, "*", "--"),
    "slots": Look("slots", VERMILION, "o", "-"),
    "mixed-slots": Look("mixed slots", GREEN, "o", "-"),
}
METERED = {"alinea": Look("ALINEA", GREY, "P", ":"), "hero": Look("HERO", GREEN, "P", "--")}
METERED_MARKER, COORDINATED_MARKER = "H", "8"
"""Of metered drivers, and of those whose meters are coordinated. They have the colour of the same
drivers without control."""


FREE_MARKERS = "h>d1"
"""Markers that no known strategy has, for those that are not known."""


def look_of(strategy: str, drivers: str | None = None) -> Look:
    """Returns how a strategy is drawn; no two that are known share colour and marker.

    One that is not known has its own name, a marker that no known one has, and always the same
    look.
    """
    if drivers is not None and strategy == "uncontrolled":
        known = UNCONTROLLED.get(drivers)
    else:
        known = COOPERATIVE.get(strategy) or _metered(strategy, drivers)
    name = f"{strategy} ({drivers})" if drivers else strategy
    return known or _look_of_another(name)


def _metered(strategy: str, drivers: str | None) -> Look | None:
    """A metering strategy; where its drivers are known, with their name and colour."""
    known = METERED.get(strategy)
    if known is None or drivers is None:
        return known
    of_drivers = UNCONTROLLED.get(drivers)
    colour = known.colour if of_drivers is None else of_drivers.colour
    label = f"{known.label}, {drivers} drivers"
    marker = COORDINATED_MARKER if strategy == "hero" else METERED_MARKER
    return replace(known, label=label, colour=colour, marker=marker)


def _look_of_another(name: str) -> Look:
    number = zlib.crc32(name.encode())
    marker = FREE_MARKERS[number // len(COLOURS) % len(FREE_MARKERS)]
    return Look(name, COLOURS[number % len(COLOURS)], marker, LINES[number % len(LINES)])


def _use_our_settings() -> None:
    for key, value in RC.items():
        mpl.rcParams[key] = value  # type: ignore[index]


class ShownFigure(Figure):
    """A figure that notebooks show as it is, whatever backend they have."""

    def _repr_png_(self) -> bytes:
        return _content(self, "png", DPI)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Returns an empty figure of a size in inches; figures are 6 to 11 in wide."""
    _use_our_settings()
    return ShownFigure(figsize=(width_in, height_in), layout="constrained")


def grid(*many: Axes) -> None:
    """Lays a faint grid behind each diagram."""
    for axes in many:
        axes.grid(alpha=0.3)
        axes.set_axisbelow(True)


def legend_below(figure: Figure | SubFigure, sources: Iterable[Axes], columns: int) -> None:
    """Writes one legend under a figure, with each label once."""
    found: dict[str, Artist] = {}
    for axes in sources:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    handles, labels = list(found.values()), list(found)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=3.0)


def save_figure(figure: Figure, path: Path, dpi: int = DPI) -> Path:
    """Writes a figure and returns its path; the ending says how (png, svg, pdf).

    The same figure gives the same bytes. Raises CorampError where it cannot be written.
    """
    write_bytes(path, _content(figure, path.suffix.lower().lstrip("."), dpi))
    return path


def _content(figure: Figure, kind: str, dpi: int) -> bytes:
    _use_our_settings()
    content = io.BytesIO()
    figure.savefig(content, format=kind, dpi=dpi, metadata=UNDATED[kind])
    return content.getvalue()


def save_plot(draw: Callable[[], Figure], path: Path) -> None:
    """Writes what is drawn to the file of an option ``--plot``; its ending says how.

    Raises CorampError where that cannot be written; nothing is drawn for an ending that says no
    format.
    """
    allowed = "allowed are png, svg and pdf files"
    if path.suffix.lower().lstrip(".") not in UNDATED:
        raise CorampError(f"--plot: {path}: the ending says no format; {allowed}")
    figure = draw()
    try:
        save_figure(figure, path, dpi=150)
    except CorampError as error:
        raise CorampError(f"--plot: {error}; {allowed}") from error
