"""Every block of the tutorial, each how-to page and experiment runs, in a folder of its own.

A block after ``<!-- not run: why -->`` is left out. Blocks of shell run under ``bash -e`` with this
Python's folder first on the path; blocks of Python share one namespace a page.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    DOCS / "tutorial.md",
    *sorted((DOCS / "how-to").glob("*.md")),
    *sorted((DOCS / "experiments").glob("*.md")),
]
BLOCK = re.compile(
    r"(?P<skip><!-- not run: (?P<why>[^>]*) -->\n)?^```(?P<kind>\w*)\n(?P<code>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    line: int
    kind: str
    code: str
    not_run: str | None


def blocks(text):
    return [
        Block(text.count("\n", 0, found.start("code")), found["kind"], found["code"], found["why"])
        for found in BLOCK.finditer(text)
    ]


def run_shell(code, folder):
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-e"],
        input=code,
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{code}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "__main__"}
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.not_run:
            continue
        if block.kind == "sh":
            run_shell(block.code, tmp_path)
        else:
            source = "\n" * block.line + block.code  # so that errors name lines of the page
            exec(compile(source, str(page), "exec"), namespace)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_has_only_blocks_that_are_run_or_say_why_not(page):
    text = page.read_text(encoding="utf-8")
    found = blocks(text)
    assert {block.kind for block in found} <= {"sh", "python"}
    assert len(re.findall(r"^```", text, re.MULTILINE)) == 2 * len(found)
    assert any(block.not_run is None for block in found)


def test_blocks_are_found_with_their_lines_and_reasons():
    text = "# A\n\n```sh\nls\n```\n\n<!-- not run: long -->\n```python\nx = 1\n\ny = 2\n```\n"
    assert blocks(text) == [
        Block(3, "sh", "ls\n", None),
        Block(8, "python", "x = 1\n\ny = 2\n", "long"),
    ]


def test_there_are_pages():
    assert len(PAGES) >= 7
