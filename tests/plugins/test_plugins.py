"""Strategies of installed packages: found, named in errors, and unable to take a study down."""

import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import coramp
from coramp.cli.skeleton import write_skeleton
from coramp.coordination.guard import Guarded
from coramp.coordination.time_limit import TooLong, time_limit
from coramp.errors import CorampError
from coramp.strategies.attempts import Attempt
from coramp.strategies.base import (
    Decision,
    DriveWithAcceleration,
    FollowTrajectory,
    ReleaseToDriver,
)
from coramp.strategies.mainline_priority import MainlinePriority
from coramp.strategies.parameters import parameter
from coramp.testing import check_strategy
from coramp.worlds.exact.engine import run_exact

STUDY = """
name = "mixed"
scenario = "paper"
horizon_s = 60.0
[[runs]]
strategies = ["mainline-priority", "{name}"]
flows_veh_h = [[1300, 600]]
engine = "exact"
"""


def raising(decide):
    raise ZeroDivisionError("no gap to divide by")


def not_finite(decide):
    command = decide.commands[0]
    pieces = command.pieces.copy()
    pieces[-1, 2] = np.nan
    return Decision((FollowTrajectory(command.row, pieces, command.merge_time_s),))


def commanding_nobody(decide):
    command = decide.commands[0]
    return Decision((FollowTrajectory(9999, command.pieces, command.merge_time_s),))


def leaving_to_drivers(decide):
    return Decision((ReleaseToDriver(decide.commands[0].row),))


def asleep(_):
    while True:
        try:
            time.sleep(60)
        except Exception:  # noqa: BLE001 - as a careless strategy does
            continue


def swallowing_everything(_):
    while True:
        try:  # noqa: SIM105
            time.sleep(60)
        except:  # noqa: E722 - as a very careless strategy does
            pass


def busy_and_swallowing_everything(_):
    while True:
        try:  # noqa: SIM105
            sum(range(1000))
        except:  # noqa: E722 - as a very careless strategy does
            pass


def leaving(_):
    sys.exit(0)


def telling_a_tale(_):
    raise RuntimeError("one line\nanother   line\n")


def commanding_nothing_at_all(_):
    return Decision(commands=None)


def waking_by_halves(_):
    return Decision(wakes_s=(5.0,))


def steering_by_none(decide):
    return Decision((DriveWithAcceleration(decide.commands[0].row, None, 0.5),))


def merging_some_time(decide):
    command = decide.commands[0]
    return Decision((FollowTrajectory(command.row, command.pieces, None),))


def commanding_half_a_row(decide):
    command = decide.commands[0]
    return Decision((FollowTrajectory(float(command.row), command.pieces, command.merge_time_s),))


def explaining_by_magic(decide):
    story = decide.explanations[0]._replace(rung="magic")
    return Decision(decide.commands, explanations=(story,))


def explaining_by_nobody(decide):
    story = decide.explanations[0]._replace(row=9999)
    return Decision(decide.commands, explanations=(story,))


def explaining_without_numbers(decide):
    story = decide.explanations[0]._replace(gap_m=None)
    return Decision(decide.commands, explanations=(story,))


def telling_of_attempts(decide, **changes):
    tried = [Attempt("free"), Attempt("reach")._replace(**changes)]
    story = decide.explanations[0]._replace(tried=tried)
    return Decision(decide.commands, explanations=(story,))


def trying_by_magic(decide):
    return telling_of_attempts(decide, rung="magic")


def trying_between_nobody(decide):
    return telling_of_attempts(decide, front_row=9999)


def trying_without_numbers(decide):
    return telling_of_attempts(decide, missing_m=None)


def trying_without_a_reason(decide):
    return telling_of_attempts(decide, reason=3)


def answering_nothing(_):
    return None


def remembering_a_list(_):
    return Decision(memory=[1])


def waking_in_the_past(_):
    return Decision(wakes_s=((-1.0, 0),))


def steering_without_a_number(decide):
    return Decision((DriveWithAcceleration(decide.commands[0].row, np.nan, 0.5),))


def steering_nobody(_):
    return Decision((DriveWithAcceleration(9999, 1.0, 0.5),))


MISTAKES = [
    (steering_without_a_number, "commands numbers that are not finite"),
    (steering_nobody, "commands an unknown vehicle, row 9999"),
    (raising, "raises ZeroDivisionError: no gap to divide by"),
    (not_finite, "commands numbers that are not finite"),
    (commanding_nobody, "commands an unknown vehicle, row 9999"),
    (leaving_to_drivers, "commands ReleaseToDriver; allowed is that where cooperative is False"),
    (asleep, "takes longer than"),
    (swallowing_everything, "takes longer than"),
    (busy_and_swallowing_everything, "takes longer than"),
    (leaving, "raises SystemExit: 0"),
    (telling_a_tale, "raises RuntimeError: one line another line"),
    (commanding_nothing_at_all, "returns what is no decision"),
    (waking_by_halves, "returns what is no decision"),
    (steering_by_none, "returns what is no decision"),
    (merging_some_time, "returns what is no decision"),
    (commanding_half_a_row, "commands an unknown vehicle, row "),
    (explaining_by_magic, "explains itself by rung 'magic'; allowed are free, reach"),
    (explaining_by_nobody, "commands an unknown vehicle, row 9999"),
    (explaining_without_numbers, "returns what is no decision"),
    (trying_by_magic, "tells of an attempt by rung 'magic'; allowed are free, reach"),
    (trying_between_nobody, "commands an unknown vehicle, row 9999"),
    (trying_without_numbers, "returns what is no decision"),
    (trying_without_a_reason, "of what it tried; allowed are Attempts"),
    (answering_nothing, "returns NoneType; allowed is a Decision"),
    (remembering_a_list, "has a memory that is not hashable"),
    (waking_in_the_past, "asks to be woken at -1.0 s"),
]


def strategy_that_is(mistake):
    """Mainline priority up to its first command, and then the mistake."""

    class Wrong:
        name, summary, cooperative = mistake.__name__.replace("_", "-"), "wrong", True

        def decide(self, view, memory):
            decision = MainlinePriority().decide(view, memory)
            return mistake(decision) if decision.commands else decision

    return Wrong


@pytest.fixture
def quick_guard(monkeypatch):
    monkeypatch.setattr(Guarded.__init__, "__defaults__", (0.3,))


@pytest.mark.parametrize(("mistake", "told"), MISTAKES)
def test_a_mistake_ends_its_run_with_a_line_that_tells_it(mistake, told, quick_guard):
    wrong = strategy_that_is(mistake)
    coramp.register(wrong)
    flows = {"mainline_veh_h": 1300, "ramp_veh_h": 600}
    with pytest.raises(CorampError) as failed:
        coramp.run("paper", wrong.name, engine="exact", horizon_s=60, **flows)
    (error,) = failed.value.messages
    assert error.startswith(f"strategy {wrong.name}: at ")
    assert told in error
    assert "\n" not in error


@pytest.mark.parametrize("mistake", [raising, busy_and_swallowing_everything, leaving])
def test_a_mistake_fails_its_own_runs_only(mistake, tmp_path, quick_guard):
    wrong = strategy_that_is(mistake)
    coramp.register(wrong, replace=True)
    (tmp_path / "s.toml").write_text(STUDY.format(name=wrong.name))
    study = coramp.study(str(tmp_path / "s.toml"), seeds=2, jobs=1, out=tmp_path / "out")
    assert study.failed["strategy"].to_list() == [wrong.name] * 2
    told = dict(MISTAKES)[mistake]
    assert all(told in error for error in study.failed["error"])
    assert study.runs.filter(status="ok")["strategy"].to_list() == ["mainline-priority"] * 2


@dataclass(frozen=True)
class Writing:
    """Plans as mainline priority does, on stations that it has moved in the view itself."""

    name: ClassVar[str] = "writing"
    summary: ClassVar[str] = "writes into the view"
    cooperative: ClassVar[bool] = True
    part: str = "fleet"

    def decide(self, view, memory):
        if self.part == "packed_rules":
            view.packed_rules[0] += 1.0
        else:
            with np.errstate(invalid="ignore"):  # places that nobody uses hold any bits at all
                getattr(view, self.part).pieces[:, 1] += 0.25
        return MainlinePriority().decide(view, memory)


@pytest.mark.parametrize("part", ["fleet", "acknowledged", "packed_rules"])
def test_one_that_writes_into_the_view_is_named_and_moves_nobody(part):
    moved = coramp.run("paper", engine="exact", mainline_veh_h=1300, ramp_veh_h=600, horizon_s=60.0)
    strategy = Guarded(Writing(part))
    with pytest.raises(CorampError, match=r"strategy writing: at .* it writes into view\."):
        run_exact(moved.scenario, strategy, 1)


def test_a_strategy_that_wakes_itself_without_end_is_stopped():
    class Restless:
        name, summary, cooperative = "restless", "never sleeps", True

        def decide(self, view, memory):
            return Decision(wakes_s=tuple((view.time_s, row) for row in view.subjects))

    coramp.register(Restless)
    with pytest.raises(CorampError, match=r"restless: at .* it wakes itself without end"):
        coramp.run("paper", "restless", engine="exact", horizon_s=60)


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, "often"])
def test_a_period_that_cannot_be_is_refused(period):
    class Pacing:
        name, summary, cooperative, period_s = "pacing", "keeps asking", True, period

        def decide(self, view, memory):
            return Decision()

    coramp.register(Pacing, replace=True)
    with pytest.raises(CorampError, match=r"strategy pacing: period_s: .* cannot be; allowed is"):
        coramp.run("paper", "pacing", engine="exact", horizon_s=60)


def test_one_of_ones_own_may_steer_and_have_parameters():
    @dataclass(frozen=True)
    class Steady:
        """Everyone keeps its speed; the supervisor lets ramp vehicles merge where that is safe."""

        name: ClassVar[str] = "steady"
        summary: ClassVar[str] = "no acceleration but the supervisor's"
        cooperative: ClassVar[bool] = True
        period_s: float = parameter(0.5, 0.1, 2.0, meaning="control period")

        def decide(self, view, memory):
            if view.subjects:
                return Decision()
            rows = view.fleet.live.tolist()
            return Decision(tuple(DriveWithAcceleration(r, 0.0, self.period_s) for r in rows))

    coramp.register(Steady, replace=True)
    run = coramp.run(
        "paper", "steady", horizon_s=60, seed=2, overrides={"strategy.steady.period_s": 1}
    )
    assert run.broken_promises == []
    assert run.summary["unserved"] == 0
    with pytest.raises(CorampError, match=r"strategy.steady.period_s: 9.* a number from 0.1 to 2"):
        coramp.run("paper", "steady", overrides={"strategy.steady.period_s": 9.0})
    check_strategy(Steady, seeds=(1,))


def test_one_that_cannot_be_made_is_named():
    class Unmade:
        name, summary, cooperative = "unmade", "cannot be made", True

        def __init__(self):
            raise RuntimeError("no licence")

        def decide(self, view, memory):
            return Decision()

    coramp.register(Unmade)
    with pytest.raises(CorampError, match="strategy unmade: raises RuntimeError: no licence"):
        coramp.run("paper", "unmade", engine="exact", horizon_s=30)


def test_the_time_limit_leaves_no_alarm():
    with time_limit(0.05):
        pass
    time.sleep(0.1)


@pytest.mark.parametrize("busy", [busy_and_swallowing_everything, swallowing_everything])
def test_the_time_limit_is_kept_every_time(busy):
    for _ in range(10):
        with pytest.raises(TooLong), time_limit(0.02):
            busy(None)


def test_the_time_limit_holds_in_other_threads():
    told = []

    def work():
        for _ in range(3):
            try:
                with time_limit(0.1):
                    while True:
                        time.sleep(0.01)
            except TooLong:
                told.append("too long")
        with time_limit(0.1):
            pass
        time.sleep(0.2)
        told.append("goes on")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(20.0)
    assert told == ["too long"] * 3 + ["goes on"]


def test_one_that_takes_too_long_to_be_made_is_named(monkeypatch):
    class Slow:
        name, summary, cooperative = "slow", "thinks before it begins", True

        def __init__(self):
            time.sleep(60)

        def decide(self, view, memory):
            return Decision()

    monkeypatch.setattr("coramp.coordination.guard.LONGEST_DECISION_S", 0.2)
    coramp.register(Slow)
    with pytest.raises(CorampError, match=r"strategy slow: takes longer than 0\.2 s to be made"):
        coramp.run("paper", "slow", engine="exact", horizon_s=30)


def test_a_correct_strategy_of_ones_own_decides_as_it_would_unguarded():
    class Same(MainlinePriority):
        name = "same"

    coramp.register(Same)
    own, ours = (
        coramp.run("paper", name, engine="exact", horizon_s=120, seed=9)
        for name in ("same", "mainline-priority")
    )
    assert own.trajectories.equals(ours.trajectories)
    assert own.decisions.equals(ours.decisions)


def installed(folder, name, module, source, entry):
    """What pip leaves of a package, as far as entry points go."""
    info = folder / f"coramp_{name}-0.3.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: coramp-{name}\nVersion: 0.3\n")
    (info / "entry_points.txt").write_text(f"[coramp.strategies]\n{name} = {module}:{entry}\n")
    (folder / f"{module}.py").write_text(source)


def coramp_with(folder, *words):
    search = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.run(
        [sys.executable, "-c", "from coramp.cli import main; main()", *words],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(search)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_installed_strategies_are_listed_with_their_origin_and_broken_ones_left_out(tmp_path):
    package = write_skeleton("mine", tmp_path / "mine")
    source = (package / "coramp_mine" / "__init__.py").read_text()
    site = tmp_path / "site"
    installed(site, "mine", "coramp_mine", source, "Mine")
    installed(site, "torn", "coramp_torn", "import nothing_such\n", "Torn")
    installed(site, "other", "coramp_other", source, "Mine")
    listed = coramp_with(site, "strategies")
    assert "mine " in listed.stdout
    assert "[coramp-mine 0.3]" in listed.stdout
    assert "torn" not in listed.stdout
    assert "Left out: strategy torn of coramp-torn 0.3: ModuleNotFoundError" in listed.stderr
    assert "strategy other of coramp-other 0.3: calls itself 'mine'" in listed.stderr
    words = ("--engine", "exact", "--horizon", "60")
    assert coramp_with(site, "run", "paper", "--strategy", "mine", *words).returncode == 0
    torn = coramp_with(site, "run", "paper", "--strategy", "torn", *words)
    assert torn.returncode == 1
    assert torn.stderr.splitlines()[-1].startswith("Error: strategy torn of coramp-torn 0.3:")
    (tmp_path / "s.toml").write_text(STUDY.format(name="mine"))
    study = coramp_with(site, "study", str(tmp_path / "s.toml"), "--seeds", "2", "--jobs", "2",
                        "--out", str(tmp_path / "out"))  # fmt: skip
    assert study.returncode == 0, study.stderr


LEAVING = "import sys\nsys.exit('no licence')\n"
COLOURED = """
class Coloured:
    name = "coloured"
    summary = "a \\x1b[31mred\\x1b[0m word,\\x07 a bell\\n and a new line\\x9b2J"
    cooperative = True
    def decide(self, view, memory): ...
"""
BROKEN_CLASS = """
class Meta(type):
    @property
    def summary(cls):
        raise SystemExit("\\x1b]0;title\\x07")
class Touchy(metaclass=Meta):
    name, cooperative = "touchy", True
    def decide(self, view, memory): ...
"""


def test_one_that_exits_at_import_does_not_silence_the_others(tmp_path):
    installed(tmp_path, "leaving", "coramp_leaving", LEAVING, "Leaving")
    installed(tmp_path, "touchy", "coramp_touchy", BROKEN_CLASS, "Touchy")
    listed = coramp_with(tmp_path, "strategies")
    assert listed.returncode == 0
    assert "mainline-priority" in listed.stdout
    assert "leaving" not in listed.stdout
    left_out = "Left out: strategy leaving of coramp-leaving 0.3: SystemExit: no licence"
    assert left_out in listed.stderr.splitlines()
    assert "Left out: strategy touchy of coramp-touchy 0.3: SystemExit: \\x1b]0;title\\x07" in (
        listed.stderr
    )
    run = coramp_with(tmp_path, "run", "paper", "--strategy", "leaving")
    assert run.returncode == 1
    assert run.stderr.startswith("Error: strategy leaving of coramp-leaving 0.3: SystemExit")


def test_a_summary_cannot_control_the_terminal(tmp_path):
    installed(tmp_path, "coloured", "coramp_coloured", COLOURED, "Coloured")
    listed = coramp_with(tmp_path, "strategies")
    (line,) = [line for line in listed.stdout.splitlines() if line.startswith("  coloured ")]
    assert all(character.isprintable() for character in line)
    assert "a \\x1b[31mred\\x1b[0m word,\\x07 a bell and a new line\\x9b2J" in line


def without_end(_):
    def deeper():
        deeper()

    deeper()


def without_end_and_a_higher_limit(_):
    sys.setrecursionlimit(10**9)
    without_end(_)


def without_end_and_swallowing_everything(_):
    def deeper():
        try:
            deeper()
        except:  # noqa: E722 - as a very careless strategy does
            deeper()

    deeper()


@pytest.mark.parametrize(
    "recursion", [without_end_and_a_higher_limit, without_end_and_swallowing_everything]
)
def test_the_time_limit_ends_recursion(recursion):
    # in a process of its own: pytest's frames and hooks would take part in what is unwound
    ended = subprocess.run(
        [sys.executable, "-c", RECURSION.format(recursion.__name__)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.stdout == "TooLong, and the limit is back\n", ended.stderr[-2000:]


RECURSION = """
import sys, time
from coramp.coordination.time_limit import TooLong, time_limit
from tests.plugins.test_plugins import {} as recursion

limit = sys.getrecursionlimit()
try:
    with time_limit(0.2):
        recursion(None)
except TooLong:
    if sys.getrecursionlimit() == limit:
        print("TooLong, and the limit is back")
"""


def test_recursion_that_python_ends_is_told_as_such(quick_guard):
    wrong = strategy_that_is(without_end)
    coramp.register(wrong)
    with pytest.raises(CorampError, match=r"at .* s it raises RecursionError: maximum recursion"):
        coramp.run("paper", wrong.name, engine="exact", mainline_veh_h=1300, horizon_s=60)


def test_recursion_within_reason_is_let_be():
    def deep(left):
        return 1 + deep(left - 1) if left else 0

    with time_limit(5.0):
        assert deep(800) == 800


def test_the_skeleton_keeps_the_contract(tmp_path, monkeypatch):
    package = write_skeleton("by-feel", tmp_path / "by-feel")
    monkeypatch.syspath_prepend(package)
    from coramp_by_feel import ByFeel

    check_strategy(ByFeel, seeds=(4,))
    assert 'by-feel = "coramp_by_feel:ByFeel"' in (package / "pyproject.toml").read_text()
    assert not [path for path in package.rglob("*") if path.is_file() and "@" in path.name]
    assert not any("@NAME@" in path.read_text() for path in package.rglob("*.py"))


@pytest.mark.parametrize("name", ["Mine", "my_own", "1st", "", "a--b", "-a"])
def test_names_that_are_none_are_refused(name, tmp_path):
    with pytest.raises(CorampError, match="is no name"):
        write_skeleton(name, tmp_path / "x")


def test_a_skeleton_overwrites_nothing(tmp_path):
    write_skeleton("mine", tmp_path / "mine")
    with pytest.raises(CorampError, match="is there already"):
        write_skeleton("mine", tmp_path / "mine")
    with pytest.raises(CorampError, match="there is such a strategy"):
        write_skeleton("uncontrolled", tmp_path / "u")


def test_the_contract_finds_what_breaks_it():
    calls = []

    class Fickle:
        name, summary, cooperative = "fickle", "never the same", True

        def decide(self, view, memory):
            calls.append(view.time_s)
            return Decision(wakes_s=((view.time_s + len(calls), view.subjects[0]),))

    class Idle:
        name, summary, cooperative = "idle", "leaves everyone waiting", True

        def decide(self, view, memory):
            return Decision()

    class Braking:
        name, summary, cooperative, period_s = (
            "braking",
            "brings the mainline to a stand",
            True,
            0.5,
        )

        def decide(self, view, memory):
            if view.subjects:
                return MainlinePriority().decide(view, memory)
            fleet = view.fleet
            rows = [row for row in fleet.live.tolist() if fleet.merge_time_s[row] < view.time_s]
            return Decision(tuple(DriveWithAcceleration(r, -1.0, 0.5) for r in rows), (), memory)

    with pytest.raises(AssertionError, match=r"braking (leaves|lets|keeps) .*"):
        check_strategy(Braking, seeds=(1,))
    with pytest.raises(CorampError, match=r"fickle: .* answers the same question differently"):
        check_strategy(Fickle)
    with pytest.raises(AssertionError, match=r"idle leaves .* waiting"):
        check_strategy(Idle)
