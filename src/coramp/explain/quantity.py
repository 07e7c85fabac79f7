"""One line of an explanation: a quantity with its equation, symbol, value and unit."""

from dataclasses import dataclass


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
