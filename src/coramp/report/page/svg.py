"""Figures as parts of a page."""

import base64
import io

from matplotlib.figure import Figure

from coramp.records.schemas import Row
from coramp.report.style import UNDATED


def picture(text: str, figure: Figure) -> Row:
    """Returns a figure as pages take it: its text alternative, and base64 of its SVG."""
    content = io.BytesIO()
    figure.savefig(content, format="svg", metadata=UNDATED["svg"])
    return {"text": text, "svg": base64.b64encode(content.getvalue()).decode("ascii")}
