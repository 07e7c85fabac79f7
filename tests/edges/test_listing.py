import json

import pytest

from coramp import _kernel
from coramp.cli.console import tell_of_compiling
from coramp.cli.listing import listing
from coramp.errors import CorampError
from coramp.scenarios.toml_files import builtin_names
from coramp.strategies.registry import register, strategies, strategy_named
from tests.edges import invoke


def test_everything_that_is_built_in_is_listed_and_described():
    found = listing()
    kinds = [kind.split()[0] for kind in found]
    assert kinds == ["scenarios", "snapshots", "studies"]
    for kind, entries in zip(kinds, found.values(), strict=True):
        assert list(entries) == builtin_names(kind)
        assert all(len(text) > 10 for text in entries.values())


def test_what_the_design_promises_is_built_in():
    assert {"paper", "expressway", "motorway"} <= set(builtin_names("scenarios"))
    assert {
        "paper",
        "sensitivity",
        "capacity",
        "field",
        "baseline",
        "drivers",
        "worth",
        "motorway",
        "penetration",
        "hostile",
    } <= set(builtin_names("studies"))
    assert "example" in builtin_names("snapshots")
    assert list(strategies()) == [
        "mainline-priority",
        "ramp-priority",
        "fifo-optimal-control",
        "dp-sequence",
        "milp-sequence",
        "game",
        "virtual-platoon",
        "ocbf",
        "slots",
        "mixed-slots",
        "alinea",
        "hero",
        "uncontrolled",
    ]


@pytest.mark.parametrize("command", ["scenarios", "strategies"])
def test_lists_are_printed_one_name_a_line_and_as_json(command):
    plain, machine = invoke(command), invoke(command, "--json")
    assert (plain.code, plain.err, machine.code, machine.err) == (0, "", 0, "")
    data = json.loads(machine.out)
    lines = [line.split(maxsplit=1) for line in plain.out.splitlines() if line.startswith(" ")]
    assert lines == [[name, text] for entries in data.values() for name, text in entries.items()]


def test_names_of_strategies_are_unique_and_known():
    first = next(iter(strategies().values()))
    with pytest.raises(CorampError, match="registered twice; use another name"):
        register(first)
    with pytest.raises(CorampError, match=r"there is no 'x'; allowed are mainline-priority, ramp"):
        strategy_named("x")
    assert strategy_named(first.name) is first


def test_nobody_can_change_the_registry_through_what_it_returns():
    strategies().clear()
    assert strategies()


@pytest.mark.parametrize("compiled", [True, False])
def test_the_first_command_says_that_kernels_are_compiled(compiled, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "kernels"
    (folder / "x").mkdir(parents=True)  # checking a scenario compiles some kernels
    if compiled:
        (folder / "x" / "separations.lane_extremes-54.py311.nbi").touch()
    monkeypatch.setattr(_kernel, "_cache_directory", lambda: folder)
    tell_of_compiling()
    said = "" if compiled else "Compiling the kernels, once (a minute or two) ...\n"
    assert capsys.readouterr() == ("", said)
