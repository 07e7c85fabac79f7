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


@pytest.fixture
def inside(mathml):
    """Returns what stands within the element of a formula."""
    return lambda tex: re.fullmatch(r"<math[^>]*>(.*)</math>", mathml(tex))[1]


@pytest.mark.parametrize(
    ("tex", "expected"),
    [
        ("v_0", "<msub><mi>v</mi><mn>0</mn></msub>"),
        ("v_{R0}", "<msub><mi>v</mi><mrow><mi>R</mi><mn>0</mn></mrow></msub>"),
        ("t^2", "<msup><mi>t</mi><mn>2</mn></msup>"),
        ("t_2'", "<msubsup><mi>t</mi><mn>2</mn><mo>\u2032</mo></msubsup>"),
        ("v_1^2", "<msubsup><mi>v</mi><mn>1</mn><mn>2</mn></msubsup>"),
        ("x^{10}", "<msup><mi>x</mi><mn>10</mn></msup>"),
        ("x^10", "<msup><mi>x</mi><mn>1</mn></msup><mn>0</mn>"),
        ("-1", "<mo>\u2212</mo><mn>1</mn>"),
        ("0.25", "<mn>0.25</mn>"),
        (r"\frac12", "<mfrac><mn>1</mn><mn>2</mn></mfrac>"),
        (r"\frac{a}{b}", "<mfrac><mi>a</mi><mi>b</mi></mfrac>"),
        (r"\tfrac T2", None),
        (r"\le", "<mo>≤</mo>"),
        ("a<b", "<mi>a</mi><mo>&lt;</mo><mi>b</mi>"),
        (r"\Delta L", "<mi>Δ</mi><mi>L</mi>"),
        (r"\text{in m/s}", "<mtext>in&#xA0;m/s</mtext>"),
        (r"\mathrm{m}", '<mi mathvariant="normal">m</mi>'),
        (r"\bar e", '<mover accent="true"><mi>e</mi><mo>¯</mo></mover>'),
        (r"\sum_i", "<munder><mo>∑</mo><mi>i</mi></munder>"),
        (r"\max(", '<mrow><mi>max</mi></mrow><mo stretchy="false">(</mo>'),
        (
            r"\underbrace{a}_{\text{b}}",
            "<munder><munder><mi>a</mi><mo>⏟</mo></munder><mtext>b</mtext></munder>",
        ),
    ],
)
def test_what_a_formula_becomes(inside, tex, expected):
    assert ET.fromstring(f"<m>{inside(tex)}</m>") is not None
    assert expected is None or inside(tex) == expected


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
    "tex", [r"\unknown", "{a", "a}", r"\begin{matrix}", r"\text a", "a_", r"\left( a", "a & b"]
)
def test_what_is_not_known_is_refused(mathml, tex):
    with pytest.raises(ValueError, match=r"in|of"):
        mathml(tex)
