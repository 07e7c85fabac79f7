"""Quantities that keys of several tables have in common, and what is allowed of them."""

from typing import Annotated

from pydantic import Field

FASTEST_MPS = 60.0

Speed = Annotated[float, Field(gt=0.0, le=FASTEST_MPS)]
Length = Annotated[float, Field(gt=0.0, le=40.0)]
