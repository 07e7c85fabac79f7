"""Formulas of the docs as MathML."""

import importlib.util
import re
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

SOURCE = Path(__file__).parents[2] / "docs" / "_site" / "mathml.py"


@pytest.fixture(scope="module")
def mathml():
    spec = importlib.util.spec_from_file_location("docs_site_mathml", SOURCE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    written, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = written
    yield module.mathml
    del sys.modules[spec.name]


@pytest.mark.parametrize(
    ("tex", "expected"),
    [
        ("v_0", "<msub><mi>v</mi><mn>0</mn></msub>"),
        ("v_{R0}", "<msub><mi>v</mi><mrow><mi>R</mi><mn>0</mn></mrow></msub>"),
        ("t_2'", "<msubsup><mi>t</mi><mn>2</mn><mi>\u2032</mi></msubsup>"),
        ("v_1^2", "<msubsup><mi>v</mi><mn>1</mn><mn>2</mn></msubsup>"),
        ("-1", "<mo>\u2212</mo><mn>1</mn>"),
        ("0.25", "<mn>0.25</mn>"),
        (r"\frac12", "<mfrac><mn>1</mn><mn>2</mn></mfrac>"),
        (r"\le", "<mo>≤</mo>"),
        ("a<b", "<mi>a</mi><mo>&lt;</mo><mi>b</mi>"),
        (r"\text{in m/s}", "<mtext>in\xa0m/s</mtext>"),
        (r"\cos", '<mo lspace="0.167em" rspace="0.167em">cos</mo>'),
        ("a/b", '<mi>a</mi><mo stretchy="false" lspace="0" rspace="0">/</mo><mi>b</mi>'),
    ],
)
def test_what_a_formula_becomes(mathml, tex, expected):
    assert f"<mrow>{expected}</mrow></math>" in mathml(tex)


def test_equation_1_has_its_three_named_parts(mathml):
    page = (SOURCE.parents[1] / "method.md").read_text(encoding="utf-8")
    tex = re.search(r"\$\$\s*(L_\{safe\} = .*?)\s*\$\$", page, re.DOTALL)[1]
    equation = ET.fromstring(mathml(tex, block=True))
    named = [under for under in equation.iter("munder") if under[0].tag == "munder"]
    assert ["".join(under[1].itertext()) for under in named] == [
        "positioning",
        "L2,\xa0clock\xa0(2)",
        "L3,\xa0speeds\xa0(3)",
    ]
    braced = ["".join(under[0][0].itertext()) for under in named]
    assert braced[0] == "2L1"
    assert braced[2].endswith("2254(ϕ+φ)")


def test_fences_stretch_and_cases_stand_in_rows(mathml):
    fenced = ET.fromstring(mathml(r"\left( \frac a b \right)^2"))
    assert [mo.text for mo in fenced.iter("mo") if mo.get("stretchy") == "true"] == ["(", ")"]
    cases = ET.fromstring(mathml(r"f = \begin{cases} a & b \\ c & d \\ \end{cases} (1)"))
    assert [len(row) for row in cases.iter("mtr")] == [2, 2]


def test_a_block_can_scroll_and_says_its_tex(mathml):
    block = ET.fromstring(mathml("a <\n b", block=True))
    assert block.tag == "div"
    assert block[0].get("display") == "block"
    assert block[0].get("alttext") == "a < b"


@pytest.mark.parametrize(
    "tex", [r"\unknown", "{a", "a}", r"\begin{matrix}", "a_", r"\left( a", "a & b"]
)
def test_what_is_not_known_is_refused(mathml, tex):
    with pytest.raises(ValueError, match=re.escape(repr(tex))):
        mathml(tex)
