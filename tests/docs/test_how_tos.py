"""Every block of the tutorial, each how-to page and experiment runs, in a folder of its own.

As a reader would follow it: all blocks in the order of the page, those of shell in one terminal, so
that a ``cd`` holds on, under ``set -e`` and with this Python's folder on the path. The tutorial
calls the installed ``coramp``, other pages one that has been imported already. Blocks of
Python share one namespace a page, and run where the terminal is. A block after
``<!-- not run: why -->`` is left out.
"""

import contextlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.docs.warm import WarmCoramp

DOCS = Path(__file__).parents[2] / "docs"
TUTORIAL = DOCS / "tutorial.md"
PAGES = [
    TUTORIAL,
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


class Terminal:
    """One bash for all blocks of a page."""

    def __init__(self, folder, files, programs):
        self._block, self._log = files / "block.sh", files / "log.txt"
        path = os.pathsep.join([*programs, str(Path(sys.executable).parent), os.environ["PATH"]])
        self._bash = subprocess.Popen(
            ["bash"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=folder,
            env={**os.environ, "PATH": path},
        )

    def run(self, code):
        """Runs a block and returns the folder in which the terminal is then."""
        self._block.write_text(code, encoding="utf-8")
        self._bash.stdin.write(f"set -e; . {self._block} < /dev/null > {self._log} 2>&1; pwd\n")
        self._bash.stdin.flush()
        folder = self._bash.stdout.readline().strip()
        assert folder, f"{code}\n{self._log.read_text(encoding='utf-8')}"
        return folder

    def close(self):
        self._bash.stdin.close()
        self._bash.stdout.close()
        self._bash.wait()


def follow(page, folder, files, programs=()):
    """Runs every block of a page, from a folder on, with folders of programs first on the path."""
    namespace = {"__name__": "__main__"}
    with contextlib.closing(Terminal(folder, files, programs)) as terminal:
        for block in blocks(page.read_text(encoding="utf-8")):
            if block.not_run:
                continue
            if block.kind == "sh":
                os.chdir(terminal.run(block.code))
            else:
                source = "\n" * block.line + block.code  # so that errors name lines of the page
                exec(compile(source, str(page), "exec"), namespace)


@pytest.fixture(scope="session")
def warm(tmp_path_factory):
    with contextlib.closing(WarmCoramp(tmp_path_factory.mktemp("warm"))) as coramp:
        yield str(coramp.folder)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_runs(page, tmp_path, tmp_path_factory, monkeypatch, warm):
    monkeypatch.chdir(tmp_path)
    programs = () if page == TUTORIAL else (warm,)
    follow(page, tmp_path, tmp_path_factory.mktemp("terminal"), programs)


def test_a_page_is_followed_in_one_terminal(tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page, files = tmp_path / "page.md", tmp_path_factory.mktemp("terminal")
    page.write_text(
        "```sh\nmkdir a\ncd a\nX=7\n```\n```python\nfrom pathlib import Path\n"
        "assert Path.cwd().name == 'a'\n```\n```sh\ntest $X = 7\ntest -d ../a\n! false\n```\n"
    )
    follow(page, tmp_path, files)
    page.write_text("```sh\ncd a\n```\n```sh\ncd a\n```\n")
    with pytest.raises(AssertionError, match="No such file"):
        follow(page, tmp_path, files)


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
