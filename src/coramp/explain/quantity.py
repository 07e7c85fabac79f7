"""One line of an explanation: a quantity with its equation, symbol, value and unit."""

from collections.abc import Sequence
from dataclasses import dataclass

from coramp.equations.printed import in_words


@dataclass(frozen=True)
class Quantity:
    """One line: its equation, symbol, what it is, value and unit."""

    equation: str
    symbol: str
    meaning: str
    value: float | bool
    unit: str = ""

    def text(self) -> str:
        """Returns the value with its unit."""
        if isinstance(self.value, bool):
            return "yes" if self.value else "no"
        return f"{self.value:.4f} {self.unit}".strip()

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of its equations."""
        return tuple(int(number) for number in self.equation.split(", ") if number)


def printed_equations(quantities: Sequence[Quantity]) -> dict[int, str]:
    """Returns the equations that the quantities are of as the paper prints them, by number."""
    numbers = {number for quantity in quantities for number in quantity.numbers}
    return {number: in_words(number) for number in sorted(numbers)}
