"""Settings of a scenario as a person writes them: "1.0 s + 2.5 m" for the gaps, names elsewhere."""

from collections.abc import Iterable, Mapping
from typing import Any

from coramp.scenarios.toml_files import override_text
from coramp.studies.overrides import scenario_value

GAPS = {"safety.time_gap_s": "s", "safety.standstill_gap_m": "m"}
NAMES = {
    "safety.positioning_error_m": "positioning error L₁ (m)",
    "safety.clock_error_s": "clock error ε (s)",
    "safety.adhesion": "adhesion φ (no unit)",
    "safety.time_gap_s": "time gap (s)",
    "safety.standstill_gap_m": "standstill gap (m)",
}
"""What keys are called beside their own words; with their unit."""
UNITS = {
    "_veh_h": "veh/h",
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_deg": "°",
    "_percent": "%",
    "_m": "m",
    "_s": "s",
}
"""By the end of a key; longer ends first."""


def key_name(key: str) -> str:
    """Returns a dotted key in words, its unit in brackets: ``acceleration lane (m)``."""
    if key in NAMES:
        return NAMES[key]
    last = key.rpartition(".")[2]
    for end, unit in UNITS.items():
        if last.endswith(end):
            return f"{last.removesuffix(end).replace('_', ' ')} ({unit})"
    return last.replace("_", " ")


def settings_text(settings: Mapping[str, Any], scenario: Mapping[str, Any] | None = None) -> str:
    """Returns settings in words: both gaps as ``1.0 s + 2.5 m``, then the others by name.

    A gap that is not set is that of the ``scenario``, left out where it is not known. No setting at
    all gives an empty text.
    """
    parts = [_setting(key, value) for key, value in settings.items() if key not in GAPS]
    if any(key in GAPS for key in settings):
        values = {key: settings.get(key, scenario_value(scenario or {}, key)) for key in GAPS}
        known = {key: value for key, value in values.items() if value is not None}
        alone = "".join(f"{key_name(key).partition(' (')[0]} " for key in known if len(known) < 2)
        time_gap_s, standstill_gap_m = (known.get(key) for key in GAPS)
        parts.insert(0, alone + gaps_text(time_gap_s, standstill_gap_m))
    return ", ".join(part for part in parts if part)


def setting_among(
    here: Mapping[str, Any], keys: Iterable[str], scenario: Mapping[str, Any] | None = None
) -> str:
    """Returns a setting in words, with the scenario's own value of what others set, by ``keys``.

    Gaps are told by name. What neither sets nor the ``scenario`` tells is left out.
    """
    values = {key: here.get(key, scenario_value(scenario or {}, key)) for key in keys}
    return settings_text({key: value for key, value in values.items() if value is not None})


def gaps_text(time_gap_s: float | None, standstill_gap_m: float | None) -> str:
    """Returns gaps that vehicles keep as ``1.0 s + 2.5 m``; one where the other is not known."""
    if time_gap_s == 0.0 and standstill_gap_m == 0.0:
        return "no gaps beyond Eq. 1"
    known = ((time_gap_s, "s"), (standstill_gap_m, "m"))
    return " + ".join(
        f"{value:.1f}" + f" {unit}" if _is_tenth(value) else f"{value:g} {unit}"
        for value, unit in known
        if value is not None
    )


def _is_tenth(value: float) -> bool:
    return value != 0.0 and abs(10.0 * value - round(10.0 * value)) < 1e-9


def _setting(key: str, value: Any) -> str:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return override_text(key, value)
    name, _, unit = key_name(key).partition(" (")
    unit = unit.removesuffix(")")
    return f"{name} {value:g}" + ("" if unit in ("", "no unit") else f" {unit}")
