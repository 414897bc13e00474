"""Which colours stand for which values: the same at all outputs of a run."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..results import Results

# Of the other fields a few points have values far from all others, which would take the whole
# range: beside a crack or without enough bonds the gradient of the displacements is undefined, and
# splinters fly
WHOLE = ("damage", "fragment")
PERCENTS = (0.5, 99.5)
# Fields that follow from the gradient of the displacements, which has no meaning in broken places
GRADIENT = ("stress", "strain", "von_mises", "principal_stress", "bond_stress", "dilatation",
            "deformation_gradient", "energy_density", "force_density")
SOUND = 0.3
MOST_OUTPUTS = 24


@dataclass(frozen=True)
class Colours:
    """A colour map with the values at its ends; `extend`: which ends have values beyond them;
    `note`: what the ends are if not the smallest and largest value.
    """

    map: str
    low: float
    high: float
    extend: str = "neither"
    note: str = ""


def sampled(results: Results) -> list[int]:
    """The outputs from which limits are taken: all, or of many some, first and last among them.
    They do not depend on the output that is drawn.
    """
    count = min(results.outputs, MOST_OUTPUTS)
    return sorted({int(k) for k in np.linspace(0, results.outputs - 1, count).round()})


def judged(results: Results, field: str, output: int) -> npt.NDArray[np.bool_]:
    """The points whose values set the limits of a field: those of the body, and of fields that
    follow from the gradient those that are not broken, where the damage was written.
    """
    body = results.body
    if field in GRADIENT and "damage" in results.fields:
        sound = body & np.asarray(results.field("damage", output) < SOUND)
        if sound.any():
            return sound
    return body


def limits_of(parts: Iterable[npt.NDArray[Any]], robust: bool) -> tuple[float, float, float, float]:
    """Limits of colours over several arrays (outputs), and their smallest and largest value.

    With `robust` the limits leave out the highest and lowest half per cent of each array, if these
    take more than a quarter of the whole range.
    """
    low = high = least = most = np.nan
    for part in parts:
        finite = part[np.isfinite(part)]
        if not finite.size:
            continue
        ends = np.percentile(finite, PERCENTS) if robust else (finite.min(), finite.max())
        low, high = np.fmin(low, ends[0]), np.fmax(high, ends[1])
        least, most = np.fmin(least, finite.min()), np.fmax(most, finite.max())
    if not np.isfinite(least):
        return 0.0, 1.0, 0.0, 1.0
    if high - low > 0.75 * (most - least):
        low, high = least, most
    return float(low), float(high), float(least), float(most)


def colours_of(field: str, parts: Iterable[npt.NDArray[Any]], broken: bool = False) -> Colours:
    """Colours for values of a field at several outputs; `broken`: values at broken points are not
    among them, which may be larger.

    Blue to red about zero if both signs matter, else light to dark; zero is in the range unless the
    values are all far from it.
    """
    if field == "damage":
        largest = max((float(np.max(part, initial=0.0)) for part in parts), default=0.0)
        return Colours("magma_r", 0.0, 1.0 if largest > 0.5 else max(largest, 1e-12))
    if field == "fragment":
        return Colours("tab20", -0.5, 19.5, note="a colour for each, small ones grey")
    low, high, least, most = limits_of(parts, robust=field not in WHOLE)
    room = 1e-9 * max(abs(least), abs(most))
    ends = (least < low - room, most > high + room)
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max",
              (True, True): "both"}[ends]
    note = "" if extend == "neither" else "0.5 to 99.5 % of points"
    if broken:
        extend = "both" if low < 0.0 else "max"
        note = f"{note}\nof damage < {SOUND}" if note else f"points of damage < {SOUND}"
    if field == "difference" or (low < -0.15 * high and high > -0.15 * low):
        bound = max(-low, high) or 1.0
        return Colours("RdBu_r", -bound, bound, extend, note)
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        # The same everywhere: a range around it, lest noise fill the picture
        middle = 0.5 * (low + high)
        width = 0.1 * abs(middle) if middle else 1.0
        return Colours("viridis", middle - width, middle + width, "neither")
    if high > 0.0 and low < 0.5 * high:
        return Colours("viridis", min(low, 0.0), high, extend, note)
    if high <= 0.0 and high > 0.5 * low:
        return Colours("viridis_r", low, 0.0, extend, note)
    return Colours("viridis" if high > 0 else "viridis_r", low, high, extend, note)


def nice_scale(displacement: float, size: float) -> float:
    """The factor by which displacements are drawn: 1 where they are seen as they are, else 1, 2 or
    5 times a power of ten, so that the largest is about 5 per cent of the body's size.
    """
    if not displacement > 1e-14 * size or size <= 0.0:
        return 0.0
    wanted = 0.05 * size / displacement
    if wanted < 2.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(factor for factor in (1.0, 2.0, 5.0) if factor * power <= wanted * 1.0001)
                 * power)
