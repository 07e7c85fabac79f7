"""docs/symbols.md names every public quantity, with its unit, and nothing that is gone."""

import math
import re
from pathlib import Path
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

import pytest
from pydantic import BaseModel

from coramp.agency.figures import FIGURES
from coramp.agency.schemas import AGENCY
from coramp.cli.ramp_listing import ramp_rows
from coramp.demand import counts
from coramp.messages import kinds
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.records import schemas
from coramp.records.corridor_outcome import CORRIDOR_FILES, CORRIDOR_RUNS, CORRIDOR_SITES, TOTALS
from coramp.runs.corridors import CONTENT
from coramp.runs.running import make_spec, run_content
from coramp.scenarios.corridor_section import CorridorSection
from coramp.scenarios.defaults import DERIVED
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.scenarios.snapshots import Snapshot
from coramp.strategies.parameters import parameters_of
from coramp.strategies.registry import strategies
from coramp.studies.definition import Study
from coramp.worlds.sumo.network import network_file, road_plan
from tests.mathematics import mathematics

PAGE = Path(__file__).parents[2] / "docs" / "symbols.md"
UNITS = {
    "veh_h": "veh/h",
    "veh_km": "veh/km",
    "pc_km_ln": "pc/km/ln",
    "pc_mi_ln": "pc/mi/ln",
    "percent": "%",
    "min": "min",
    "mps3": "m/s3",
    "mps2": "m/s2",
    "mps": "m/s",
    "deg": "deg",
    "wpkg": "W/kg",
    "kg": "kg",
    "km": "km",
    "per_h": "",
    "h": "h",
    "m": "m",
    "s": "s",
    "l": "l",
}
SEVERITY = "m2/s4"
EQUATIONS = 48
FILES = {
    "vehicles.parquet": schemas.VEHICLES,
    "types.parquet": schemas.TYPES,
    "trajectories.parquet": schemas.TRAJECTORIES,
    "decisions.parquet": schemas.DECISIONS,
    "attempts.parquet": schemas.ATTEMPTS,
    "speeds.parquet": schemas.SPEEDS,
    "runs.parquet": schemas.RUNS,
    "safety_events.parquet": schemas.SAFETY_EVENTS,
    "heard.parquet": schemas.HEARD,
    "on_board.parquet": schemas.ON_BOARD,
    "streams.parquet": schemas.STREAM_ROWS,
    "messages.parquet": kinds.COLUMNS,
    **{f"{name}.csv": columns for name, columns in AGENCY.items()},
    "coramp compare --json": FIGURES,
    "detectors.csv": counts.SCHEMA,
    **{f"{name}.parquet": schema for name, schema in CORRIDOR_FILES.items()},
    "runs.parquet of a corridor's study": CORRIDOR_RUNS,
    "sites.parquet of a corridor's study": CORRIDOR_SITES,
}
RAMPS = "coramp ramps --json"
MODELS = {
    "Scenario keys": Scenario,
    "Corridor keys": CorridorSection,
    "Study keys": Study,
    "Snapshot keys": Snapshot,
}


def sections():
    """Returns each section's table as a list of rows, each a dict by column."""
    tables, heading, columns = {}, "", []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            heading, columns = line[3:], []
            tables[heading] = []
        elif line.startswith("|") and not line.startswith("|---"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if not columns:
                columns = cells
            else:
                tables[heading].append(dict(zip(columns, cells, strict=True)))
    return tables


TABLES = sections()


def names(section):
    return [row["name"].strip("`") for row in TABLES[section]]


def inner_model(annotation):
    """Returns the model in an annotation and what stands for its place: nothing, NAME or N."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, None
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated or origin in (Union, UnionType):
        for argument in arguments:
            found = inner_model(argument)
            if found is not None:
                return found
    if origin is dict and arguments and isinstance(arguments[1], type):
        return (arguments[1], "NAME") if issubclass(arguments[1], BaseModel) else None
    if origin is tuple and arguments and isinstance(arguments[0], type):
        return (arguments[0], "N") if issubclass(arguments[0], BaseModel) else None
    return None


def inner_models(annotation):
    """Returns every model in an annotation, as ``inner_model`` does; a union may have several."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return inner_models(arguments[0])
    if origin in (Union, UnionType):
        return [found for argument in arguments for found in inner_models(argument)]
    found = inner_model(annotation)
    return [] if found is None else [found]


def keys_of(model, prefix=""):
    """Returns every dotted key of a model with its field."""
    keys = {}
    for name, field in model.model_fields.items():
        found = inner_models(field.annotation)
        if not found:
            keys[prefix + name] = field
        for inner, place in found:
            keys.update(keys_of(inner, f"{prefix}{name}." + (f"{place}." if place else "")))
    return keys


def functions_that_cite():
    """Returns the public functions of the mathematics whose docstring cites an equation."""
    found = set()
    for module_name, module in mathematics().items():
        for name, value in vars(module).items():
            function = getattr(value, "py_func", value)
            if getattr(function, "__module__", None) != module.__name__ or name.startswith("_"):
                continue
            if not isinstance(value, type) and re.search(r"\(Eq\. \d", function.__doc__ or ""):
                found.add(f"{module_name}.{name}")
    return found


@pytest.mark.parametrize("file", FILES)
def test_every_column_of_a_file_stands_there_once_and_in_order(file):
    assert names(file) == list(FILES[file])


def told(default):
    """A default as a scenario file has it, without a text's quotes."""
    if isinstance(default, bool):
        return str(default).lower()
    return default if isinstance(default, str) else f"{default:g}"


def test_every_parameter_of_a_strategy_stands_there_as_it_is():
    found = [
        (f"{name}.{p.name}", told(p.default), p.allowed, p.meaning)
        for name, strategy in strategies().items()
        for p in parameters_of(strategy)
    ]
    written = [tuple(v.strip("`") for v in row.values()) for row in TABLES["Strategy parameters"]]
    assert written == found
    assert all(meaning for *_, meaning in found)


def test_every_key_of_run_json_stands_there():
    assert sorted(names("run.json")) == sorted(run_content(make_spec("paper"), {}))


def test_every_key_of_a_corridors_run_stands_there_in_order():
    assert names("run.json of a corridor") == list(CONTENT)
    assert names("Totals of a corridor") == list(TOTALS)


def test_every_key_of_an_on_ramp_stands_there_in_order():
    network = read_network(network_file(road_plan(load_scenario("paper"))))
    (row,) = ramp_rows(on_ramps(network))
    assert names(RAMPS) == list(row)


@pytest.mark.parametrize("section", MODELS)
def test_every_key_of_a_model_stands_there_once(section):
    assert sorted(names(section)) == sorted(keys_of(MODELS[section]))


@pytest.mark.parametrize("section", MODELS)
def test_defaults_are_those_of_the_models(section):
    fields = keys_of(MODELS[section])
    for row in TABLES[section]:
        name, shown = row["name"].strip("`"), row["default"].strip("`")
        field = fields[name]
        default = field.get_default(call_default_factory=True)
        if section == "Scenario keys" and name in DERIVED:
            assert shown == "derived", name
        elif field.is_required():
            assert shown == "required", name
        elif default is None:
            assert shown == "derived", name
        elif isinstance(default, float):
            assert math.isclose(float(shown), default, rel_tol=1e-12, abs_tol=0.0), name
        elif isinstance(default, str) and default:
            assert shown == default, name
        else:
            assert shown.replace('"', "'") == repr(default), name


@pytest.mark.parametrize("section", [*FILES, *MODELS, RAMPS])
def test_units_are_those_that_the_names_end_in(section):
    for row in TABLES[section]:
        name = row["name"].strip("`").rsplit(".", 1)[-1]
        expected = next((unit for end, unit in UNITS.items() if name.endswith(f"_{end}")), "")
        if "severity" in name:
            expected = SEVERITY
        assert row["unit"] == expected, name


def test_every_row_says_what_it_means():
    for section, rows in TABLES.items():
        for row in rows:
            assert row["meaning"], f"{section}: {row}"


def test_every_equation_of_the_paper_stands_there():
    cited = {
        int(number)
        for row in TABLES["The paper's symbols"]
        for number in re.findall(r"\d+", row["Eq."])
    }
    assert cited == set(range(1, EQUATIONS + 1))


def test_every_function_that_cites_an_equation_stands_there():
    named = {row["function"].strip("`") for row in TABLES["The paper's symbols"]} - {""}
    missing = functions_that_cite() - named
    assert not missing


def test_every_function_named_exists():
    modules = mathematics()
    for row in TABLES["The paper's symbols"]:
        if function := row["function"].strip("`"):
            module, name = function.split(".")
            assert callable(getattr(modules[module], name))
