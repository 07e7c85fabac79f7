"""docs/reference/equations.md names a function for every equation, and these cite it."""

import importlib
import inspect
import re
from pathlib import Path

import pytest

from coramp.equations.printed import EQUATIONS as EQUATIONS_AS_PRINTED
from tests.mathematics import mathematics

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "equations.md"
ERRATA = PAGE.parents[1] / "errata.md"
EQUATIONS = 48
ROW = re.compile(r"\| (\d+) \| (.+?) \| ((?:[^|\\]|\\\|)+) \| (.+) \|$")
LINK = re.compile(r"\[`([\w.]+)`\]\(([\w-]+\.md)#(coramp\.[\w.]+)\)")


def rows():
    """Returns the page's table: by equation, the links to its functions."""
    found = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if cells := ROW.match(line):
            assert int(cells[1]) not in found
            found[int(cells[1])] = LINK.findall(cells[4])
    return found


def told():
    """Returns what the page's table says of each equation: what it gives, and its printed form."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    matches = [found for line in lines if (found := ROW.match(line))]
    return {
        int(cells[1]): (cells[2], cells[3].replace("\\|", "|").replace("`", ""))
        for cells in matches
    }


ROWS = rows()
LINKS = {(number, *link) for number, links in ROWS.items() for link in links}


def numbers(text):
    """Returns the equations that a text cites: ``Eq. 3``, ``Eq. 3, 15 and 16``, ``Eq. 1-4``."""
    cited = set()
    text = " ".join(text.split())
    for found in re.finditer(r"Eq\. (\d+(?:(?:-|, | and | or |; )(?:Eq\. )?\d+)*)", text):
        parts = re.split(r", | and | or |; ", found[1].replace("Eq. ", ""))
        for part in parts:
            first, _, last = part.partition("-")
            cited.update(range(int(first), int(last or first) + 1))
    return cited


def function_of(path):
    module, name = path.rsplit(".", 1)
    value = getattr(importlib.import_module(module), name)
    return getattr(value, "py_func", value)


def docstrings():
    """Returns every docstring of the mathematics by the name of what it belongs to."""
    found = {}
    for module_name, module in mathematics().items():
        found[module_name] = module.__doc__ or ""
        for name, value in vars(module).items():
            plain = getattr(value, "py_func", value)
            if getattr(plain, "__module__", None) == module.__name__ and plain.__doc__:
                found[f"{module_name}.{name}"] = plain.__doc__
    return found


def test_citations_are_read():
    assert numbers("of Eq. 3, 15 and 16, and so on") == {3, 15, 16}
    assert numbers("(Eq. 1-4) and (Eq. 15-17)") == {1, 2, 3, 4, 15, 16, 17}
    assert numbers("(Eq. 23; Eq. 33 for t_2')") == {23, 33}
    assert numbers("(Eq. 22; 32 for a_r')") == {22, 32}
    assert numbers("nothing of 5 vehicles") == set()


def test_the_page_has_the_printed_forms_that_explanations_show():
    shown = told()
    for number, equation in EQUATIONS_AS_PRINTED.items():
        read_as = f"; read: {equation.read_as}" if equation.read_as else ""
        assert shown[number] == (equation.gives, equation.printed + read_as)


def test_every_misprint_is_in_the_errata():
    errata = ERRATA.read_text(encoding="utf-8")
    misread = {n for n, e in EQUATIONS_AS_PRINTED.items() if e.read_as}
    assert misread == {n for n in misread if f"({n})" in errata}
    assert {27, 28, 29, 31, 33, 39, 48} <= misread


def test_every_equation_has_its_row_in_order():
    assert list(ROWS) == list(range(1, EQUATIONS + 1))
    assert all(ROWS.values())


@pytest.mark.parametrize(("number", "shown", "page", "path"), sorted(LINKS))
def test_a_named_function_exists_and_cites_its_equation(number, shown, page, path):
    function = function_of(path)
    assert inspect.isfunction(function)
    assert path.endswith(f".{shown}")
    assert number in numbers(function.__doc__)


@pytest.mark.parametrize(("number", "shown", "page", "path"), sorted(LINKS))
def test_a_link_leads_to_the_page_of_its_module(number, shown, page, path):
    text = (PAGE.parent / page).read_text(encoding="utf-8")
    assert f"::: {path.rsplit('.', 1)[0]}\n" in text


@pytest.mark.parametrize("name", sorted(docstrings()))
def test_every_equation_that_the_core_cites_stands_there(name):
    assert numbers(docstrings()[name]) <= ROWS.keys()


def test_a_function_whose_first_line_ends_in_an_equation_stands_in_its_row():
    for name, text in docstrings().items():
        first = text.splitlines()[0]
        if (name.count(".") == 1) and (found := re.search(r"\(Eq\. [^)]*\)", first)):
            for number in numbers(found[0]):
                named = {shown for shown, _, _ in ROWS[number]}
                assert name in named, f"{name}: Eq. {number}"
