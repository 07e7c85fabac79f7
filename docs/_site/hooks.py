"""What the site needs beyond MkDocs: pages from files outside docs/, and formulas as MathML."""

import re
from html import unescape
from pathlib import Path

from mathml import mathml
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

OUTSIDE = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Files beside docs/ and the pages that they become."""
FORMULA = re.compile(
    r'<span class="arithmatex">\\\((?P<inline>.*?)\\\)</span>'
    r'|<div class="arithmatex">\s*\\\[(?P<block>.*?)\\\]\s*</div>',
    re.DOTALL,
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds a page for each file outside docs/; there, links into docs/ begin with that folder."""
    root = Path(config.config_file_path).parent
    for name, page in OUTSIDE.items():
        text = (root / name).read_text(encoding="utf-8").replace("](docs/", "](")
        for outside, inside in OUTSIDE.items():
            text = text.replace(f"]({outside}", f"]({inside}")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Returns a page whose links to files outside docs/ lead to their pages."""
    up = "../" * page.file.src_uri.count("/")
    for name, inside in OUTSIDE.items():
        markdown = markdown.replace(f"]({up}../{name}", f"]({up}{inside}")
    return markdown


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Returns a page whose formulas are MathML; one that is not known stops the build."""
    try:
        return FORMULA.sub(_formula, html)
    except ValueError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from None


def _formula(found: re.Match[str]) -> str:
    block = found["block"] is not None
    tex = unescape(found["block"] if block else found["inline"])
    return mathml(tex.strip(), block=block)
