"""Units that read well, and what a picture says of a state."""
from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..results import Results

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "\u00b5"),
            (1e-9, "n"))
# Prefixes that read well before a unit, by the symbol it begins with; others have none
USUAL = {"Pa": "GMk", "N": "GMkm\u00b5", "J": "Mkm\u00b5n", "W": "Mkm\u00b5", "s": "m\u00b5n",
         "m": "m\u00b5n", "m/s": "m\u00b5"}


@dataclass(frozen=True)
class Scale:
    """How values are shown: times `factor`, with the unit `text` (in matplotlib's notation)."""

    factor: float
    text: str

    def label(self, name: str) -> str:
        """The name with the unit in brackets."""
        return f"{name} [{self.text}]" if self.text else name


def scale_of(unit: str, values: npt.ArrayLike) -> Scale:
    """The prefix with which the largest of the values lies between 1 and 1000, if it is usual for
    the unit. Small and large numbers without unit get a power of ten.
    """
    finite = np.abs(np.asarray(values, dtype=float))
    finite = finite[np.isfinite(finite)]
    largest = float(finite.max()) if finite.size else 0.0
    if unit in ("", "1", "-"):
        if largest == 0.0 or 1e-2 <= largest < 1e5:
            return Scale(1.0, "")
        power = 3 * int(np.floor(np.log10(largest) / 3))
        return Scale(10.0 ** -power, f"10$^{{{power}}}$")
    usual = USUAL.get(unit) or USUAL.get(_first(unit), "") if _first(unit) != "m" else USUAL.get(
        unit, "")
    best = Scale(1.0, in_text(unit))
    for size, prefix in PREFIXES:
        if prefix and prefix not in usual:
            continue
        best = Scale(1.0 / size, prefix + in_text(unit))
        # A hair of tolerance: 0.001 m is 1 mm though its double is less
        if largest * (1 + 1e-9) >= size:
            return best
    # Smaller than the smallest prefix, or nothing but zeros
    return best if largest > 0.0 else Scale(1.0, in_text(unit))


def _first(unit: str) -> str:
    """The symbol that a unit begins with: Pa of Pa m1/2, J of J/m2; of a power (m2) none."""
    match = re.match(r"([A-Za-z]+)(?![\^\d])", unit)
    return match.group(1) if match else ""


def in_text(unit: str) -> str:
    """A unit with raised exponents: J/m2 as J/m$^2$."""
    return re.sub(r"(?<=[A-Za-z])\^?\(?(-?\d+(?:/\d+|\.\d+)?)\)?", r"$^{\1}$", unit)


def number(value: float) -> str:
    """A number of a title: at most four digits."""
    return f"{value:.4g}"


def state_text(results: Results, output: int) -> str:
    """What moment an output shows: `t = 9.44 us`, or `load factor 0.5` in statics."""
    value = float(results.times[output])
    if results.static:
        return f"load factor {number(value)}"
    scale = scale_of("s", [value])
    return f"t = {number(value * scale.factor)} {scale.text}"


def abscissa(results: Results) -> tuple[npt.NDArray[Any], str]:
    """What curves of the history stand over: time in a unit that reads well, or the load factor."""
    time = np.asarray(results.history["time"], dtype=float)
    if results.static:
        return time, "load factor"
    scale = scale_of("s", time)
    return time * scale.factor, scale.label("time")


def words(name: str) -> str:
    """The name of a field or column as a label has it."""
    return name.replace("_", " ")
