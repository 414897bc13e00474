"""Where panels stand in a picture. Sizes are in inches, so that labels have room and bodies keep
their shape whatever it is.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

FONT = 8.0
LINE = 0.145


@dataclass(frozen=True)
class Panel:
    """One panel: its height over its width; where its colour bar is, 'beside', 'below' or none, and
    how many lines the bar's label has; whether it has a title and axes.
    """

    shape: float
    bar: str = "beside"
    lines: int = 1
    title: bool = False
    axes: bool = True

    @property
    def left(self) -> float:
        """Room for the numbers and the label of the upright axis."""
        return 0.58 if self.axes else 0.08

    @property
    def right(self) -> float:
        """Room for the colour bar, its numbers and its label."""
        return 0.17 + 0.42 + LINE * self.lines if self.bar == "beside" else 0.12

    @property
    def top(self) -> float:
        """Room for the title."""
        return 0.26 if self.title else 0.1

    @property
    def bottom(self) -> float:
        """Room for the numbers and the label of the lower axis, and a colour bar below."""
        return ((0.45 if self.axes else 0.08)
                + (0.1 + 0.3 + LINE * self.lines if self.bar == "below" else 0.0))

    def size(self, width: float, most: float) -> tuple[float, float]:
        """Width and height of what is drawn in, within a whole width and a largest height."""
        inner = max(width - self.left - self.right, 0.4)
        height = inner * self.shape
        if height > most:
            inner, height = inner * most / height, most
        return inner, height


@dataclass
class Place:
    """The axes of a panel and of its colour bar."""

    axes: Axes
    bar: Axes | None


def lay_out(rows: Sequence[Sequence[Panel | None]], width: float, caption: bool = True,
            most: float = 6.0) -> tuple[Figure, list[list[Place | None]]]:
    """A figure with rows of panels, each at most `width` wide in all and `most` high inside."""
    columns = max(len(row) for row in rows)
    sizes = [[panel.size(width, most) if panel else (0.0, 0.0) for panel in row] for row in rows]
    wide = [max((row[c].left + size[c][0] + row[c].right  # type: ignore[union-attr]
                 for row, size in zip(rows, sizes) if c < len(row) and row[c] is not None),
                default=0.0) for c in range(columns)]
    high = [max((panel.top + size[1] + panel.bottom for panel, size in zip(row, line) if panel),
                default=0.0) for row, line in zip(rows, sizes)]
    above = 0.3 if caption else 0.0
    total = np.array([sum(wide), sum(high) + above])
    figure = Figure(figsize=(float(total[0]), float(total[1])))

    def axes_at(left: float, bottom: float, across: float, up: float) -> Axes:
        return figure.add_axes((float(left / total[0]), float(bottom / total[1]),
                                float(across / total[0]), float(up / total[1])))

    found: list[list[Place | None]] = []
    top = total[1] - above
    for row, line, height in zip(rows, sizes, high):
        places: list[Place | None] = []
        for c, panel in enumerate(row):
            if panel is None:
                places.append(None)
                continue
            across, up = line[c]
            # In the middle of its column, and of its row as far as labels leave it
            spare = wide[c] - panel.left - across - panel.right
            left = sum(wide[:c]) + panel.left + spare / 2
            bottom = top - panel.top - up - (height - panel.top - up - panel.bottom) / 2
            axes = axes_at(left, bottom, across, up)
            bar = None
            if panel.bar == "beside":
                bar = axes_at(left + across + 0.07, bottom, 0.1, up)
            elif panel.bar == "below":
                down = 0.5 if panel.axes else 0.14
                bar = axes_at(left, bottom - down - 0.1, across, 0.1)
            places.append(Place(axes, bar))
        found.append(places)
        top -= height
    return figure, found


def write_caption(figure: Figure, text: str) -> None:
    """The line above all panels."""
    height = float(figure.get_size_inches()[1])
    figure.text(0.5, 1 - 0.06 / height, text, ha="center", va="top", fontsize=FONT + 1)


def new_figure(width: float, height: float) -> Figure:
    """A figure of curves, whose panels arrange themselves."""
    return Figure(figsize=(width, height), layout="constrained")
