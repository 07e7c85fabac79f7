"""From the TeX of the docs to MathML, which browsers draw without scripts and without fonts."""

from xml.etree import ElementTree as ET

from latex2mathml.converter import Converter

TEX_ONLY = frozenset("\\{}&_^")
"""What latex2mathml leaves as it is where it does not know the TeX."""


def mathml(tex: str, *, block: bool = False) -> str:
    """Returns a formula as a ``math`` element; raises ValueError for TeX that is not known.

    A block stands in a ``div`` of its own, so that it can scroll where the page is narrow.
    """
    tex = " ".join(tex.split())
    if tex.count("{") != tex.count("}"):
        raise ValueError(f"a brace is missing in {tex!r}")
    try:
        root = ET.fromstring(Converter(display="block" if block else "inline").convert(tex))
    except Exception as error:  # its errors have no class in common
        raise ValueError(f"{type(error).__name__} in {tex!r}") from error
    for part in root.iter():
        part.tag = part.tag.rpartition("}")[2]
        if part.tag == "mi" and TEX_ONLY & set(part.text or ""):
            raise ValueError(f"{part.text} is not known in {tex!r}")
        if part.text in ("/", "|") and "fence" not in part.attrib:
            part.attrib.update(stretchy="false", lspace="0", rspace="0")
        if part.tag in ("mi", "mo") and len(part.text or "") > 1 and part.text.isalpha():
            part.tag = "mo"  # a function, such as cos; browsers give it no space, or too much
            part.attrib.update(lspace="0.167em", rspace="0.167em")
    root.set("alttext", tex)
    html = ET.tostring(root, encoding="unicode")
    return f'<div class="formula">{html}</div>' if block else html
