"""How coramp is found: version, ``python -m coramp``, completion, the citation."""

import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import yaml

import coramp
from tests.edges import invoke

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_version_is_said_in_every_way():
    version = metadata.version("coramp")
    assert invoke("--version").out == f"coramp {version}\n"
    assert invoke("--version").code == 0
    assert coramp.__version__ == version == PROJECT["version"]


def test_the_module_is_the_command():
    command = [sys.executable, "-m", "coramp", "run", "--help"]
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    assert told.stdout.splitlines()[0].startswith("Usage: python -m coramp run [OPTIONS]")
    wrong = subprocess.run([*command[:3], "run", "nowhere"], capture_output=True, check=False)
    assert wrong.returncode == 1


def test_completion_in_a_notebook_finds_the_api():
    assert set(coramp.__all__) <= set(dir(coramp))
    assert not [name for name in dir(coramp) if not hasattr(coramp, name)]
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        _ = coramp.runn


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("coramp stud", ["studio", "study"]),
        ("coramp run pa", ["paper"]),
        ("coramp run paper -s ramp", ["ramp-priority"]),
        ("coramp study sens", ["sensitivity"]),
        ("coramp plan ex", ["example"]),
        ("coramp studio express", ["expressway"]),
        ("coramp run paper --keep", ["--keep-messages", "--keep-sumo"]),
    ],
)
def test_a_shell_completes(line, words):
    asked = {"_CORAMP_COMPLETE": "complete_bash", "COMP_WORDS": line}
    asked["COMP_CWORD"] = str(len(line.split()) - 1)
    program = "import sys; sys.argv = ['coramp']; from coramp.cli import main; main()"
    told = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert sorted(told.stdout.split()) == words


def test_the_citation_is_of_this_version_and_this_paper():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    (paper,) = citation["references"]
    readme = " ".join((ROOT / "README.md").read_text().split())
    assert paper["title"] in readme
    assert [author["family-names"] for author in paper["authors"]][:2] == ["Peng", "Xu"]
    assert len(paper["authors"]) == 9


def test_every_claimed_python_is_one_that_is_allowed():
    claimed = [
        found.group(1)
        for line in PROJECT["classifiers"]
        if (found := re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line))
    ]
    assert claimed[0] == PROJECT["requires-python"].removeprefix(">=")
    assert f"{sys.version_info.major}.{sys.version_info.minor}" in claimed
