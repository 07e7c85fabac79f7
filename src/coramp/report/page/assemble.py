"""One HTML file that works without a network: template, scripts, styles and runs in it."""

import base64
import gzip
import json
from collections.abc import Iterable, Sequence
from functools import cache
from importlib import resources
from typing import Any

import jinja2

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.page.shown import page_data
from coramp.scenarios.model import Scenario

LIBRARY = "uplot-1.6.32.min.js"
STYLES = ("uplot-1.6.32.min.css", "page.css")
SCRIPTS = (
    "motion.js",
    "details.js",
    "diagram.js",
    "delay.js",
    "looks.js",
    "heard.js",
    "strip.js",
    "road.js",
    "replay.js",
    "page.js",
)
LANES_SCRIPT, MAP_SCRIPT = "lanes.js", "map.js"
"""What pages have beside these where the mainline has several lanes, and in a network."""
REPORT_SCRIPTS = ("report.js",)


def assembled(
    template: str,
    own: Sequence[str] = REPORT_SCRIPTS,
    scenarios: Iterable[Scenario] = (),
    **values: Any,
) -> str:
    """Returns a page from one of the templates, with scripts and styles in it.

    ``own`` are the scripts that it has beside those of every page, ``scenarios`` those of which it
    shows runs.
    """
    shown = tuple(scenarios)
    beside = [LANES_SCRIPT] if any(s.mainline.lanes > 1 for s in shown) else []
    beside += [MAP_SCRIPT] if any(s.network is not None for s in shown) else []
    return rendered(
        template,
        styles=[asset(name) for name in STYLES],
        library=asset(LIBRARY),
        scripts="\n".join(asset(name) for name in (*SCRIPTS, *beside, *own)),
        **values,
    )


def plain(template: str, scripts: Sequence[str] = (), **values: Any) -> str:
    """Returns a page without the scripts of one merge site's runs, with the named ones alone."""
    return rendered(
        template,
        styles=[asset(name) for name in STYLES],
        library="",
        scripts="\n".join(asset(name) for name in scripts),
        cells=[],
        **values,
    )


def rendered(template: str, **values: Any) -> str:
    """Returns a template with its values in it."""
    return _environment().get_template(template).render(**values) + "\n"


@cache
def asset(name: str) -> str:
    """Returns the text of one of the files that pages are made of."""
    folder = resources.files("coramp.report.page") / "assets"
    return (folder / name).read_text(encoding="utf-8")


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("coramp.report.page"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def packed(run: RunRecords) -> str:
    """Returns a run as the page unpacks it: base64 of gzipped JSON; the same run, the same text."""
    return packed_data(page_data(run))


def packed_data(data: Row) -> str:
    """Returns plain data as a page unpacks it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")
