"""Curves of the history: load over displacement, crack tips, energies, J, probes."""
from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..results import Results, split_component
from .fields import tidy
from .layout import FONT, new_figure
from .units import abscissa, scale_of, words

Array = npt.NDArray[Any]
LINES = ("-", "--", ":", "-.")


def curve_pictures(runs: Sequence[Results]) -> dict[str, Figure]:
    """All pictures of histories that there is something to draw in, by name. Of several runs each
    has a style of lines.
    """
    makers: dict[str, Callable[[Sequence[Results]], Figure | None]] = {
        "load_displacement": load_displacement, "reactions": reactions, "tips": tips,
        "energies": energies, "j_integral": j_integral, "breaking": breaking, "probes": probes,
        "iterations": iterations}
    made = {name: maker(runs) for name, maker in makers.items()}
    return {name: figure for name, figure in made.items() if figure is not None}


def _panels(count: int, width: float = 5.0, height: float = 2.3,
            shared: bool = True) -> tuple[Figure, list[Axes]]:
    """Panels one over the other."""
    figure = new_figure(width, height * count + 0.3)
    panels = figure.subplots(count, 1, sharex=shared, squeeze=False)[:, 0]
    return figure, list(panels)


def _style(runs: Sequence[Results], number: int, rows: int) -> dict[str, Any]:
    """The line of a run; a few rows (load steps) are marked."""
    few = rows <= 60
    return {"linewidth": 1.1, "linestyle": LINES[number % len(LINES)],
            "marker": "o" if few and runs[number].static else "", "markersize": 2.5}


def _named(runs: Sequence[Results], run: Results, text: str) -> str:
    """A label, with the run where there are several."""
    return text if len(runs) == 1 else f"{run.name}: {text}"


def _finish(panels: Sequence[Axes], label: str) -> None:
    """The shared axis, grids, and legends above, where they hide no curve. A curve alone is named
    by its axis.
    """
    for axes in panels:
        axes.grid(alpha=0.3)
        tidy(axes)
        handles, labels = axes.get_legend_handles_labels()
        if len(labels) > 1:
            columns = max(1, min(len(labels), 78 // (max(map(len, labels)) + 6)))
            axes.legend(handles, labels, fontsize=FONT - 1.5, ncols=columns, frameon=False,
                        loc="lower left", bbox_to_anchor=(-0.02, 1.0), borderaxespad=0.2)
    panels[-1].set_xlabel(label, fontsize=FONT)


def _draw(axes: Axes, runs: Sequence[Results], names: Sequence[str], ylabel: str,
          name_of: Callable[[str], str] = words) -> None:
    """Columns of one unit over time or load factor."""
    unit = next(run.units[name] for run in runs for name in names if name in run.history)
    scale = scale_of(unit, np.concatenate([run.history[name] for run in runs for name in names
                                           if name in run.history]))
    time = _time_scale(runs)
    for number, run in enumerate(runs):
        for place, name in enumerate(name for name in names if name in run.history):
            axes.plot(np.asarray(run.history["time"]) * time[0],
                      np.asarray(run.history[name]) * scale.factor, color=f"C{place % 10}",
                      label=_named(runs, run, name_of(name)),
                      **_style(runs, number, len(run.history["time"])))
    if len(runs) == 1 and len(names) == 1:
        ylabel = words(names[0])
    axes.set_ylabel(scale.label(ylabel), fontsize=FONT)


def _time_scale(runs: Sequence[Results]) -> tuple[float, str]:
    """Factor and label of the axis over which histories stand: that of the longest run."""
    longest = max(runs, key=lambda run: float(np.max(run.history["time"], initial=0.0)))
    values, label = abscissa(longest)
    largest = float(np.max(longest.history["time"], initial=0.0))
    return (float(np.max(values)) / largest if largest else 1.0), label


def _important(run: Results, boundary: str, kind: str) -> list[str]:
    """Components x, y, z of a boundary's columns that are not small beside its largest one."""
    sizes = {axis: float(np.abs(run.history[f"{boundary}_{kind}_{axis}"]).max())
             for axis in "xyz" if f"{boundary}_{kind}_{axis}" in run.history}
    largest = max(sizes.values(), default=0.0)
    return [axis for axis, size in sizes.items() if largest and size > 0.02 * largest]


def load_displacement(runs: Sequence[Results]) -> Figure | None:
    """The reaction of each named boundary over its mean displacement, where it moves."""
    wanted: dict[str, str] = {}
    for run in runs:
        for boundary in run.boundaries:
            moving = [axis for axis in _important(run, boundary, "reaction")
                      if f"{boundary}_displacement_{axis}" in run.history
                      and np.ptp(run.history[f"{boundary}_displacement_{axis}"]) > 0.0]
            if moving:
                wanted.setdefault(boundary, max(moving, key=lambda axis: float(
                    np.abs(run.history[f"{boundary}_reaction_{axis}"]).max())))
    if not wanted:
        return None
    columns = 2 if len(wanted) > 1 else 1
    rows = -(-len(wanted) // columns)
    figure = new_figure(4.4 if columns == 1 else 7.0, 2.9 * rows)
    for place, (boundary, axis) in enumerate(wanted.items()):
        axes = figure.add_subplot(rows, columns, place + 1)
        force, moved = f"{boundary}_reaction_{axis}", f"{boundary}_displacement_{axis}"
        there = [run for run in runs if force in run.history and moved in run.history]
        across = scale_of("m", np.concatenate([run.history[moved] for run in there]))
        up = scale_of("N", np.concatenate([run.history[force] for run in there]))
        for number, run in enumerate(there):
            axes.plot(np.asarray(run.history[moved]) * across.factor,
                      np.asarray(run.history[force]) * up.factor, color="C0",
                      label=run.name if len(runs) > 1 else None,
                      **_style(runs, runs.index(run), len(run.history[force])))
        axes.set_title(words(boundary), fontsize=FONT + 1)
        axes.set_ylabel(up.label(f"reaction {axis}"), fontsize=FONT)
        _finish([axes], across.label(f"mean displacement {axis}"))
    return figure


def reactions(runs: Sequence[Results]) -> Figure | None:
    """The reactions of all named boundaries over time or load factor."""
    names = list(dict.fromkeys(
        f"{boundary}_reaction_{axis}" for run in runs for boundary in run.boundaries
        for axis in _important(run, boundary, "reaction")))
    if not names:
        return None
    figure, panels = _panels(1, height=2.9)
    _draw(panels[0], runs, names, "reaction", lambda name: words(name.replace("_reaction", "")))
    _finish(panels, _time_scale(runs)[1])
    return figure


def tips(runs: Sequence[Results]) -> Figure | None:
    """Length and, of explicit runs, speed of the crack tips."""
    names = list(dict.fromkeys(tip for run in runs for tip in run.tips))
    kinds = [("length", "crack length")]
    if not all(run.static for run in runs):
        kinds.append(("speed", "crack speed"))
    kinds = [kind for kind in kinds if any(f"{name}_{kind[0]}" in run.history for run in runs
                                           for name in names)]
    if not names or not kinds:
        return None
    figure, panels = _panels(len(kinds))
    for axes, (kind, label) in zip(panels, kinds):
        _draw(axes, runs, [f"{name}_{kind}" for name in names], label,
              lambda name, kind=kind: words(name[:-len(kind) - 1]))  # type: ignore[misc]
    _finish(panels, _time_scale(runs)[1])
    return figure


def energies(runs: Sequence[Results]) -> Figure | None:
    """Energies of the whole body that are not zero, and of explicit runs how far they are from a
    balance.
    """
    def wanted(run: Results, name: str) -> bool:
        return (run.origins[name] in ("run", "") and run.units[name] == "J"
                and bool(np.any(run.history[name]))
                and not (run.static and name == "kinetic_energy"))
    names = list(dict.fromkeys(name for run in runs for name in run.history if wanted(run, name)))
    if not names:
        return None
    needed = ("kinetic_energy", "strain_energy", "dissipated_energy", "external_work")
    moving = [run for run in runs if not run.static and all(name in run.history for name in needed)]
    figure = new_figure(5.0, 4.2 if moving else 3.0)
    panels = (list(figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))) if moving
              else [figure.subplots()])
    _draw(panels[0], runs, names, "energy")
    if moving:
        gaps = []
        for run in moving:
            h = run.history
            stored = h["kinetic_energy"] + h["strain_energy"] + h["dissipated_energy"]
            gaps.append(stored - stored[0] - (h["external_work"] - h["external_work"][0]))
        scale, time = scale_of("J", np.concatenate(gaps)), _time_scale(runs)[0]
        for run, gap in zip(moving, gaps):
            panels[1].plot(np.asarray(run.history["time"]) * time, gap * scale.factor, color="0.3",
                           **_style(runs, runs.index(run), len(gap)))
        panels[1].set_ylabel(scale.label("balance"), fontsize=FONT)
    _finish(panels, _time_scale(runs)[1])
    return figure


def is_j(run: Results, name: str) -> bool:
    """Whether a column is a J integral or a stress intensity that follows from it."""
    return (run.origins[name] == "j_integral"
            or bool(re.search(r"_(j|k_?(i|ii|1|2))$", name, re.IGNORECASE)))


def j_integral(runs: Sequence[Results]) -> Figure | None:
    """J integrals and stress intensities, a panel for each unit."""
    units: dict[str, list[str]] = {}
    for run in runs:
        for name in run.history:
            if is_j(run, name) and np.any(np.nan_to_num(run.history[name])):
                units.setdefault(run.units[name], []).append(name)
    if not units:
        return None
    figure, panels = _panels(len(units))
    for axes, (unit, names) in zip(panels, units.items()):
        _draw(axes, runs, list(dict.fromkeys(names)), "J" if unit == "J/m2" else "K")
    _finish(panels, _time_scale(runs)[1])
    return figure


def breaking(runs: Sequence[Results]) -> Figure | None:
    """Broken bonds, and pieces of the body where the history counts them."""
    kinds = [name for name in ("broken_bonds", "fragments", "largest_fragment_mass")
             if any(name in run.history and np.any(np.diff(run.history[name])) for run in runs)]
    if not kinds:
        return None
    figure, panels = _panels(len(kinds))
    for axes, name in zip(panels, kinds):
        _draw(axes, runs, [name], words(name))
    _finish(panels, _time_scale(runs)[1])
    return figure


def probes(runs: Sequence[Results]) -> Figure | None:
    """What probes recorded, a panel for each unit; components that are zero are left out."""
    units: dict[str, list[str]] = {}
    for run in runs:
        for name in run.history:
            if (run.origins[name] == "probe" and np.any(np.nan_to_num(run.history[name]))
                    and not (run.static and "_velocity" in name)):
                units.setdefault(run.units[name], []).append(name)
    if not units:
        return None
    for unit, names in units.items():
        # A component that is zero but for rounding
        sizes = {name: max(float(np.abs(run.history[name]).max()) for run in runs
                           if name in run.history) for name in names}
        units[unit] = [name for name in names if sizes[name] > 1e-3 * max(sizes.values())]
    figure, panels = _panels(len(units))
    for axes, names in zip(panels, units.values()):
        fields = {re.sub(r"^.*?_(?=[a-z]+$)", "", split_component(name)[0]) for name in names}
        _draw(axes, runs, list(dict.fromkeys(names)),
              words(fields.pop()) if len(fields) == 1 else "probes")
    _finish(panels, _time_scale(runs)[1])
    return figure


def iterations(runs: Sequence[Results]) -> Figure | None:
    """The way of a relaxation to its tolerance: residual and change of displacement over all
    iterations of iterations.csv. Where a load step begins there is a vertical line.
    """
    path = runs[0].folder / "iterations.csv"
    if len(runs) > 1 or not runs[0].static or not path.is_file():
        return None
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        return None
    columns = {name: np.array([float(row[name]) for row in rows])
               for name in ("step", "load_step", "residual", "change")}
    figure, (axes,) = _panels(1, height=2.6)
    for name, label in (("residual", "residual"), ("change", "change of displacement")):
        shown = columns[name] > 0
        axes.semilogy(columns["step"][shown], columns[name][shown], linewidth=1, label=label)
    begins = np.flatnonzero(np.diff(columns["load_step"]) > 0) + 1
    for number in begins if len(begins) <= 60 else ():
        axes.axvline(columns["step"][number], color="0.7", linewidth=0.6, zorder=0)
    axes.set_ylabel("relative", fontsize=FONT)
    axes.grid(alpha=0.3)
    axes.tick_params(labelsize=FONT - 1)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.legend(fontsize=FONT - 1)
    axes.set_xlabel("iteration, of all load steps" if len(begins) else "iteration", fontsize=FONT)
    return figure
