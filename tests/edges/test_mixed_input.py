"""What mixed traffic refuses, in one line each, and what it cannot show."""

import pytest

import coramp
from coramp import CorampError
from coramp.scenarios.loading import load_scenario
from tests.edges import assert_refused, invoke

SMALL = ("--mainline", "1000", "--ramp", "400", "--horizon", "30")
HALF = ("--set", "traffic.automated_share=0.5")


def told_of(*words, strategy="mixed-slots"):
    return invoke("run", "paper", "-s", strategy, *SMALL, *words)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("automated_share=1.5", "1.5 is too large; allowed is at most 1"),
        ("automated_share=-0.1", "-0.1 is too small; allowed is at least 0"),
        ("automated_share=nan", "nan is not finite; allowed is a finite number"),
        ("automated_share=inf", "inf is not finite; allowed is a finite number"),
        ("automated_share=half", "'half' is not a number; allowed is a number"),
        ("ramp_automated_share=2", "2 is too large; allowed is at most 1"),
        ("mainline_automated_share=2", "2 is too large; allowed is at most 1"),
        ("connected_share=2", "2 is too large; allowed is at most 1"),
        ("automation=maybe", "'maybe' is not known; allowed is 'yielding',"),
        ("automated_shar=0.5", "unknown key; did you mean automated_share?"),
        ("drivers=fast", "there is no 'fast'; allowed are paper, fair,"),
    ],
)
def test_what_cannot_be_in_traffic_is_told_with_its_key(setting, told):
    refused = told_of("--set", f"traffic.{setting}")
    assert_refused(refused)
    (line,) = refused.errors
    assert f"traffic.{setting.split('=')[0]}: {told}" in line


def test_a_misspelt_section_is_told():
    refused = told_of("--set", "trafic.automated_share=0.5")
    assert_refused(refused)
    assert "trafic: unknown key; did you mean traffic?" in refused.errors[0]


def test_a_share_of_a_type_is_bounded_too():
    types = '[{name="car", share=0.9}, {name="truck", share=0.1, automated_share=1.5}]'
    refused = told_of("--set", f"vehicle={types}")
    assert_refused(refused)
    assert "vehicle.1.automated_share: 1.5 is too large; allowed is at most 1" in refused.errors[0]


@pytest.mark.parametrize(
    ("words", "strategy", "told"),
    [
        (
            (),
            "slots",
            (
                "strategy: slots cannot run where [traffic] leaves some vehicles to drivers; "
                "allowed are mixed-slots, alinea, uncontrolled, or automated shares of 1"
            ),
        ),
        (
            ("--engine", "exact"),
            "mixed-slots",
            (
                "engine: exact cannot run where [traffic] leaves some vehicles to drivers; choose "
                "sumo, or automated shares of 1"
            ),
        ),
        (
            ("--set", 'drivers.fair.integrator="ballistic"'),
            "mixed-slots",
            (
                "drivers.fair.integrator: ballistic drivers are others than Euler's, and automated "
                "vehicles among them take Euler steps; allowed is euler"
            ),
        ),
        (
            ("--set", "strategy.mixed-slots.decision_s=0.8"),
            "mixed-slots",
            (
                "--set: strategy.mixed-slots.decision_s: 0.8 cannot be; allowed is a number from "
                "0.1 to 0.5"
            ),
        ),
    ],
)
def test_what_mixed_traffic_cannot_do_is_told(words, strategy, told):
    refused = told_of(*HALF, *words, strategy=strategy)
    assert_refused(refused)
    assert refused.errors == [f"Error: {told}"]


def test_ballistic_drivers_alone_are_no_mixed_traffic():
    """Without an automated vehicle nobody is held to Euler steps."""
    ballistic = {"drivers.fair.integrator": "ballistic", "traffic.automated_share": 0.0}
    spec = coramp.api.make_spec("paper", "mixed-slots", overrides=ballistic)
    assert not spec.is_mixed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixed") / "run"
    told = told_of(*HALF, "--out", folder)
    assert told.code == 0
    assert told.err == ""
    assert told.out.endswith(f"Records are in {folder}; coramp report {folder} shows them.\n")
    return folder


def test_what_was_not_kept_is_not_explained(folder):
    for vehicle in ("r00001", "m00001"):
        refused = invoke("explain", folder, vehicle)
        assert_refused(refused)
        assert refused.errors == [
            (
                f"Error: {folder}: vehicles among drivers drive without plans, and what they did "
                "on board was not kept; run again with --keep-messages"
            )
        ]
    refused = invoke("explain", folder, "r00001", "--plot", folder / "p.png")
    assert_refused(refused)
    assert "--plot: it draws a plan" in refused.errors[0]
    with pytest.raises(CorampError, match="so that there is none to plot"):
        coramp.load(folder).plot_decision("r00001")


def test_there_is_nothing_to_audit(folder):
    refused = invoke("audit", folder)
    assert_refused(refused)
    assert refused.errors == [
        (
            f"Error: {folder}: automated vehicles drove among drivers here, and such runs keep no "
            "log that an audit could repeat; audit a run of automated vehicles alone, or of "
            "drivers alone"
        )
    ]


def test_a_scenario_is_shown_with_its_traffic(tmp_path):
    own = tmp_path / "own.toml"
    built_in = invoke("scenarios", "paper").out
    own.write_text(built_in + "\n[traffic]\nautomated_share = 0.4\nramp_automated_share = 0.7\n")
    shown = invoke("scenarios", own).out
    assert (
        "[traffic]\n"
        "automated_share = 0.4\n"
        "# mainline_automated_share = 0.4  # follows from automated_share, 1 where that is left "
        "out\n"
        "ramp_automated_share = 0.7\n"
        'drivers = "fair"  # default\n'
        "connected_share = 1.0  # default\n"
        'automation = "yielding"  # default\n'
    ) in shown
    again = tmp_path / "again.toml"
    again.write_text(shown)
    assert load_scenario(str(again)).traffic.share_of(False) == 0.4
    assert load_scenario(str(again)).traffic.share_of(True) == 0.7
    assert "# ramp_automated_share = 1.0" in invoke("scenarios", written(tmp_path, built_in)).out


def written(folder, text):
    path = folder / "plain.toml"
    path.write_text(text)
    return path
