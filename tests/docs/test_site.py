"""The docs site builds without a warning, and nothing in it comes from another host."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[2]
LOADS = {"src", "srcset", "poster", "data", "background"}
FOLLOWED_ONLY = {"canonical", "prev", "next", "alternate"}
ELSEWHERE = re.compile(r"^\s*(?:https?:)?//", re.IGNORECASE)


class Reader(HTMLParser):
    """Collects what a page loads, where its links lead and which anchors it has."""

    def __init__(self):
        super().__init__()
        self.loaded, self.links, self.anchors, self.styles = [], [], set(), []

    def handle_starttag(self, tag, attrs):
        found = {name: value or "" for name, value in attrs}
        self.loaded += [value for name, value in found.items() if name in LOADS]
        if tag == "link" and found.get("rel") not in FOLLOWED_ONLY:
            self.loaded.append(found["href"])
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        self.anchors.update(value for name, value in found.items() if name in {"id", "name"})
        self.styles.append(found.get("style", ""))


def read(page):
    reader = Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    return reader


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Returns the folder of the site and what building it printed."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    return folder, output


@pytest.fixture(scope="module")
def pages(built):
    folder, _ = built
    return {path.relative_to(folder): read(path) for path in folder.rglob("*.html")}


def test_it_builds_without_a_warning(built):
    _, output = built
    assert "warning" not in output.lower(), output
    assert "Documentation built" in output


def test_every_page_of_the_docs_is_there(pages):
    excluded = ROOT / "docs" / "_site"
    sources = [path for path in (ROOT / "docs").rglob("*.md") if excluded not in path.parents]
    expected = {path.relative_to(ROOT / "docs").with_suffix(".html") for path in sources}
    assert len(expected) >= 30
    assert expected | {Path("contributing.html"), Path("changelog.html")} <= pages.keys()


def test_no_page_loads_anything_from_another_host(pages):
    for path, page in pages.items():
        assert page.loaded, path
        assert [url for url in page.loaded if ELSEWHERE.search(url)] == [], path
        assert not [style for style in page.styles if "//" in style], path


def test_no_stylesheet_loads_anything_from_another_host(built):
    folder, _ = built
    sheets = list(folder.rglob("*.css"))
    assert sheets
    for path in sheets:
        text = path.read_text(encoding="utf-8")
        urls = re.findall(r"(?:url\(|@import)\s*[\"']?([^\"')\s]+)", text)
        assert [url for url in urls if ELSEWHERE.search(url)] == [], path


def test_every_link_within_the_site_leads_somewhere(built, pages):
    folder, _ = built
    for path, page in pages.items():
        if path == Path("404.html"):  # its links are absolute
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = path.parent / unquote(parts.path) if parts.path else path
            target = Path(os.path.normpath(target))
            target = target / "index.html" if (folder / target).is_dir() else target
            assert (folder / target).exists(), f"{path}: {link}"
            if parts.fragment and target.suffix == ".html":
                assert unquote(parts.fragment) in pages[target].anchors, f"{path}: {link}"


def test_formulas_are_drawn(built):
    folder, _ = built
    source = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    method = (folder / "method.html").read_text(encoding="utf-8")
    assert method.count('<math display="block"') == source.count("$$") / 2 > 10
    for page in folder.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "arithmatex" not in text, page
        assert "$$" not in text, page


def test_the_reference_has_signatures_and_docstrings(built):
    folder, _ = built
    for page, words in {
        "api": ["coramp.api.run", "coramp.results.RunResult", "Runs a scenario once"],
        "safe-distance": [
            "coramp.equations.safe_distance.safe_distance_m",
            "bumper to bumper (Eq. 1)",
        ],
        "checker": [
            "coramp.checker.checker.examine",
            "Returns whether a change may be committed",
        ],
    }.items():
        text = (folder / "reference" / f"{page}.html").read_text(encoding="utf-8")
        for word in words:
            assert word in text, page


def test_examples_are_code(built):
    folder, _ = built
    for page in ("api", "trajectory"):
        text = (folder / "reference" / f"{page}.html").read_text(encoding="utf-8")
        assert "<blockquote>" not in text, page
        assert re.search(r"<pre[^>]*>(?:(?!</pre>).)*&gt;&gt;&gt;", text, re.DOTALL), page


def test_links_have_titles_not_file_names():
    pages = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    for path in [*pages, *(ROOT / "docs").rglob("*.md")]:
        named = re.findall(r"\[[`\w./-]+\.(?:md|ipynb)`?\]\(", path.read_text(encoding="utf-8"))
        assert named == [], path
