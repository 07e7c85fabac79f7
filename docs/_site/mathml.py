"""From the TeX of the docs to MathML, which browsers draw without scripts and without fonts.

It knows what the docs use and a little more; whatever it does not know is a ValueError.
"""

import re
from dataclasses import dataclass, field
from html import escape

TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|\d+(?:\.\d+)?|[^\W\d_]|\s+|.", re.DOTALL)
LETTERS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "epsilon": "ϵ",
    "varepsilon": "ε",
    "eta": "η",
    "theta": "θ",
    "kappa": "κ",
    "lambda": "λ",
    "mu": "μ",
    "nu": "ν",
    "pi": "π",
    "rho": "ρ",
    "sigma": "σ",
    "tau": "τ",
    "phi": "ϕ",
    "varphi": "φ",
    "psi": "ψ",
    "omega": "ω",
    "ell": "ℓ",
    "Delta": "Δ",
    "Sigma": "Σ",
    "Phi": "Φ",
    "Omega": "Ω",
    "infty": "∞",
}
OPERATORS = {
    "le": "≤",
    "leq": "≤",
    "ge": "≥",
    "geq": "≥",
    "ne": "≠",
    "neq": "≠",
    "approx": "≈",
    "pm": "±",
    "cdot": "⋅",
    "times": "×",
    "in": "∈",
    "to": "→",
    "ldots": "…",
    "dots": "…",
    "cdots": "⋯",
    "lvert": "|",
    "rvert": "|",
    "{": "{",
    "}": "}",
    "%": "%",
}
LARGE = {"sum": "∑", "prod": "∏", "int": "∫"}
FUNCTIONS = {"max", "min", "cos", "sin", "tan", "ln", "log", "exp"}
SPACES = {"quad": 1.0, "qquad": 2.0, ",": 0.167, ":": 0.222, ";": 0.278, " ": 0.25, "!": -0.167}
FENCES = {"lvert": "|", "rvert": "|", "{": "{", "}": "}", ".": ""}
PLAIN_OPERATORS = {"-": "−", "*": "∗", "'": "′"}
UNDER = {"underbrace": "⏟", "underline": "_"}
OVER = {"bar": "¯", "overline": "¯", "hat": "^", "dot": "˙", "overbrace": "⏞"}


def mathml(tex: str, *, block: bool = False) -> str:
    """Returns a formula as a ``math`` element; raises ValueError for TeX that is not known."""
    body = "".join(_Parser(tex).row(until=None))
    alttext = escape(" ".join(tex.split()))
    if block:
        return f'<div class="formula"><math display="block" alttext="{alttext}">{body}</math></div>'
    return f'<math alttext="{alttext}">{body}</math>'


@dataclass
class _Parser:
    tex: str
    tokens: list[str] = field(init=False)
    upright: bool = False

    def __post_init__(self) -> None:
        self.tokens = TOKEN.findall(self.tex)[::-1]

    def row(self, until: str | None) -> list[str]:
        """Returns the elements up to ``until``, which is taken; None stands for the end."""
        elements: list[str] = []
        while True:
            self.skip_space()
            if not self.tokens:
                if until is None:
                    return elements
                raise ValueError(f"{until} is missing in {self.tex!r}")
            if self.tokens[-1] == until:
                self.tokens.pop()
                return elements
            elements.append(self.with_scripts())

    def skip_space(self) -> None:
        while self.tokens and self.tokens[-1].isspace():
            self.tokens.pop()

    def take(self, token: str) -> bool:
        """Returns whether ``token`` is next, and takes it if it is."""
        self.skip_space()
        if self.tokens and self.tokens[-1] == token:
            self.tokens.pop()
            return True
        return False

    def with_scripts(self) -> str:
        """Returns the next element with its subscript, superscript and primes."""
        limits = self.tokens[-1].lstrip("\\") in {*LARGE, *UNDER, *OVER}
        base = self.atom()
        below, above, primes = "", "", 0
        while True:
            if self.take("'"):
                primes += 1
            elif not below and self.take("_"):
                below = self.argument()
            elif not above and self.take("^"):
                above = self.argument()
            else:
                break
        if primes:
            mark = f"<mo>{'′' * primes}</mo>"
            above = f"<mrow>{mark}{above}</mrow>" if above else mark
        if below and above:
            name = "munderover" if limits else "msubsup"
            return f"<{name}>{base}{below}{above}</{name}>"
        if below:
            name = "munder" if limits else "msub"
            return f"<{name}>{base}{below}</{name}>"
        if above:
            name = "mover" if limits else "msup"
            return f"<{name}>{base}{above}</{name}>"
        return base

    def atom(self) -> str:
        """Returns the next element without what is set above and below it."""
        self.skip_space()
        if not self.tokens:
            raise ValueError(f"something is missing at the end of {self.tex!r}")
        token = self.tokens.pop()
        if token == "{":
            return _grouped(self.row(until="}"))
        if token.startswith("\\"):
            return self.command(token[1:])
        if token[0].isdigit():
            return f"<mn>{token}</mn>"
        if token.isalpha():
            return self.letter(token)
        if token in "_^}&":
            raise ValueError(f"{token!r} is not expected in {self.tex!r}")
        return _operator(PLAIN_OPERATORS.get(token, token))

    def argument(self) -> str:
        """Returns what a command or a script takes: as in TeX one digit only, unless in braces."""
        self.skip_space()
        if self.tokens and self.tokens[-1][0].isdigit():
            number = self.tokens.pop()
            if number[1:]:
                self.tokens.append(number[1:])
            return f"<mn>{number[0]}</mn>"
        return self.atom()

    def letter(self, letter: str) -> str:
        upright = ' mathvariant="normal"' if self.upright else ""
        return f"<mi{upright}>{letter}</mi>"

    def command(self, name: str) -> str:
        """Returns what a command stands for, with its arguments."""
        if name in LETTERS:
            return self.letter(LETTERS[name])
        if name in OPERATORS:
            return _operator(OPERATORS[name])
        if name in LARGE:
            return f"<mo>{LARGE[name]}</mo>"
        if name in SPACES:
            return f'<mspace width="{SPACES[name]}em"/>'
        if name in FUNCTIONS:
            self.skip_space()
            close = not self.tokens or self.tokens[-1] in {"(", "\\left", "^", "_"}
            space = "" if close else '<mspace width="0.167em"/>'
            return f"<mrow><mi>{name}</mi>{space}</mrow>"
        if name in UNDER:
            return f"<munder>{self.atom()}<mo>{UNDER[name]}</mo></munder>"
        if name in OVER:
            return f'<mover accent="true">{self.atom()}<mo>{OVER[name]}</mo></mover>'
        return self.structure(name)

    def structure(self, name: str) -> str:
        """Returns a fraction, a root, words, a pair of fences or the cases of a formula."""
        if name in {"frac", "tfrac", "dfrac"}:
            fraction = f"<mfrac>{self.argument()}{self.argument()}</mfrac>"
            if name == "frac":
                return fraction
            style = "true" if name == "dfrac" else "false"
            return f'<mstyle displaystyle="{style}">{fraction}</mstyle>'
        if name == "sqrt":
            return f"<msqrt>{self.atom()}</msqrt>"
        if name == "text":
            return f"<mtext>{escape(self.words()).replace(' ', '&#xA0;')}</mtext>"
        if name == "mathrm":
            outside, self.upright = self.upright, True
            inner = self.atom()
            self.upright = outside
            return inner
        if name == "left":
            opening = self.fence()
            inner = "".join(self.row(until="\\right"))
            return f"<mrow>{opening}{inner}{self.fence()}</mrow>"
        if name == "begin":
            return self.cases()
        raise ValueError(f"\\{name} is not known in {self.tex!r}")

    def words(self) -> str:
        """Returns what stands in braces, as it is."""
        if not self.take("{"):
            raise ValueError(f"\\text needs braces in {self.tex!r}")
        taken = []
        while self.tokens:
            token = self.tokens.pop()
            if token == "}":
                return "".join(taken)
            taken.append(token)
        raise ValueError(f"}} is missing in {self.tex!r}")

    def fence(self) -> str:
        token = self.tokens.pop() if self.tokens else "."
        sign = FENCES.get(token.lstrip("\\"), token)
        return f'<mo fence="true" stretchy="true">{escape(sign)}</mo>' if sign else ""

    def cases(self) -> str:
        """Returns the rows of ``cases`` behind a brace."""
        if self.words() != "cases":
            raise ValueError(f"only cases can begin in {self.tex!r}")
        rows: list[list[list[str]]] = [[[]]]
        while not self.take("\\end"):
            if not self.tokens:
                raise ValueError(f"\\end{{cases}} is missing in {self.tex!r}")
            if self.take("&"):
                rows[-1].append([])
            elif self.take("\\\\"):
                rows.append([[]])
            else:
                rows[-1][-1].append(self.with_scripts())
        self.words()
        table = ""
        for row in rows:
            if row != [[]]:
                cells = "".join(f"<mtd>{''.join(cell)}</mtd>" for cell in row)
                table += f"<mtr>{cells}</mtr>"
        return f'<mrow><mo fence="true" stretchy="true">{{</mo><mtable>{table}</mtable></mrow>'


def _grouped(elements: list[str]) -> str:
    return elements[0] if len(elements) == 1 else f"<mrow>{''.join(elements)}</mrow>"


def _operator(sign: str) -> str:
    still = ' stretchy="false"' if sign in "()[]{}|" else ""
    close = ' lspace="0" rspace="0"' if sign in "|/" else ""
    return f"<mo{still}{close}>{escape(sign)}</mo>"
