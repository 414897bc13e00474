"""Pictures of the results in a folder.

    ./pf plot DIR [--field NAME ...] [--step N | all] [--magnify FACTOR] [--to FOLDER]

writes a picture of every field (1D: a curve over x; 2D: coloured points; 3D: all points and a cut
through the middle) and the curves of the history: energies, probes, reactions; of explicit runs the
balance of energies, of a relaxation the residual over its iterations. Of a study it draws error against time with the Pareto front, and error against each varied key. DIR
is the folder of the results or of the study, or the .vtkhdf or study.csv file.
"""
import argparse
import csv
import re
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.collections import PolyCollection  # noqa: E402
from matplotlib.ticker import MaxNLocator  # noqa: E402

from common import Results  # noqa: E402


def values_of(results, name, output=-1):
    """Values (n) of a field, of a component of it ('displacement_x', 'NAME_xy'), or the magnitude
    of a vector or tensor; and a label.
    """
    base, _, component = name.rpartition("_")
    if name in results.fields:
        base = name
        values = results.field(name, output)
        label = name.replace("_", " ")
        if values.ndim == 2:
            # Components off the diagonal of a symmetric tensor stand for two each
            names = results.components[name]
            times = [2 if len(set(c)) == 2 and c[::-1] not in names else 1 for c in names]
            values, label = np.sqrt((values**2) @ times), f"|{label}|"
    elif base in results.fields and component in results.components[base]:
        values = results.field(base, output)[:, results.components[base].index(component)]
        label = f"{base.replace('_', ' ')} {component}"
    else:
        raise KeyError(f"{results.path.name} has no field '{name}'; "
                       f"it has {', '.join(results.fields)} "
                       "(a vector's component: displacement_x)")
    return values, label + in_brackets(results.field_units[base])


def in_brackets(unit):
    """A unit as an axis shows it, with raised exponents; nothing for a number without one."""
    if unit in ("", "1"):
        return ""
    return " [" + re.sub(r"(\d+)", r"$^\1$", unit) + "]"


def dimension_of(points):
    """1, 2 or 3: directions in which the points differ."""
    extent = np.ptp(points, axis=0)
    used = extent > 1e-9 * extent.max()
    return 3 if used[2] else 2 if used[1] else 1


def spacing_of(results, dim):
    """A typical distance between neighbours: exact on a lattice that fills its box."""
    sample = results.points[:: max(1, len(results.points) // 2000)]
    best = np.inf
    # Sorted along x, then y, neighbours of a lattice are next to one another
    for axis in range(dim):
        steps = np.diff(np.unique(np.round(results.points[:, axis], 12)))
        steps = steps[steps > 1e-6 * np.ptp(results.points[:, axis])]
        if len(steps):
            best = min(best, np.median(steps))
    extent = np.ptp(results.points, axis=0)[:dim]
    mean = (np.prod(np.maximum(extent, best)) / len(results.points))**(1 / dim)
    # In a cloud coordinates hardly repeat, and the steps between them say nothing
    return best if best > 0.2 * mean and len(sample) > 1 else mean


def colours_of(values):
    """Colour map and limits: blue to red about zero if both signs matter, else light to dark."""
    low, high = float(values.min()), float(values.max())
    if low < -0.05 * high < 0:
        bound = max(-low, high)
        return {"cmap": "RdBu_r", "vmin": -bound, "vmax": bound}
    return {"cmap": "viridis", "vmin": min(low, 0.0) if high > 0 else low,
            "vmax": high if high > low else low + 1}


def positions_of(results, output, magnify):
    """Positions moved by the displacement times a factor; reference positions without
    displacement.
    """
    if magnify == 0.0 or "displacement" not in results.fields:
        return results.points
    return results.points + magnify * results.field("displacement", output)


def draw_points(axis, positions, values, spacing, colours, size):
    """Squares of a spacing's width in the plane; `size` (width, height) of the picture's axis in
    inches.
    """
    low, high = positions.min(axis=0) - spacing / 2, positions.max(axis=0) + spacing / 2
    inches = min(size[0] / (high[0] - low[0]), size[1] / (high[1] - low[1]))
    # In units of the axis: markers are rounded to pixels and would leave white lines between them
    side = max(spacing * 1.02, 0.8 / 72 / inches)
    corners = side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    drawn = PolyCollection(positions[:, None, :2] + corners, array=values, cmap=colours["cmap"],
                           linewidths=0, antialiaseds=False, rasterized=True)
    drawn.set_clim(colours["vmin"], colours["vmax"])
    axis.add_collection(drawn)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    return drawn


def draw(figure, place, results, name, output, title, magnify, window=None, limits=None):
    """One panel: a field at an output. `place`: rows, columns, number; `window`: x and y limits
    [m].
    """
    values, label = values_of(results, name, output)
    dim = dimension_of(results.points)
    positions = positions_of(results, output, magnify)
    if dim == 1:
        axis = figure.add_subplot(*place)
        order = np.argsort(results.points[:, 0])
        axis.plot(results.points[order, 0], values[order], linewidth=1)
        axis.set(xlabel="x [m]", ylabel=label, title=title)
        axis.grid(alpha=0.3)
        return
    spacing = spacing_of(results, dim)
    width, height = figure.get_size_inches() / np.array([place[1], place[0]])
    colours = colours_of(values)
    if limits:
        colours.update(vmin=limits[0], vmax=limits[1])
    if dim == 3:
        axis = figure.add_subplot(*place, projection="3d")
        # More points than a picture can show only make it slow
        shown = slice(None, None, max(1, len(positions) // 60000))
        drawn = axis.scatter(*positions[shown].T, c=values[shown], s=4, linewidths=0,
                             depthshade=False, **colours)
        extent = np.ptp(positions, axis=0)
        axis.set_box_aspect(np.maximum(extent, 0.05 * extent.max()), zoom=1.15)
        # Labels of short sides would lie on top of one another
        for side, length, ticks in zip("xyz", extent, (axis.xaxis, axis.yaxis, axis.zaxis)):
            if length > 0.3 * extent.max():
                ticks.set_label_text(f"{side} [m]")
            else:
                ticks.set_ticks([])
        axis.tick_params(labelsize=6)
    else:
        axis = figure.add_subplot(*place)
        if window:
            inside = np.all([(positions[:, c] >= window[c][0]) & (positions[:, c] <= window[c][1])
                             for c in (0, 1)],
                            axis=0)
            positions, values = positions[inside], values[inside]
        drawn = draw_points(axis, positions, values, spacing, colours, (0.7 * width, 0.75 * height))
        axis.set(xlabel="x [m]", ylabel="y [m]")
        axis.ticklabel_format(scilimits=(-2, 3))
    axis.set_title(title, fontsize=10)
    figure.colorbar(drawn, ax=axis, shrink=0.75 if dim == 2 else 0.5,
                    pad=0.05 if dim == 2 else 0.12, label=label)


def figure_of_fields(items, path, columns=1, magnify=0.0, panel=(5.0, 3.6), window=None,
                     limits=None, dpi=80):
    """One picture of several panels, each (results, field, title) or (results, field, title,
    output).
    """
    rows = -(-len(items) // columns)
    figure = plt.figure(figsize=(panel[0] * columns, panel[1] * rows))
    for number, (results, name, title, *output) in enumerate(items, 1):
        draw(figure, (rows, columns, number), results, name, output[0] if output else -1, title,
             magnify, window,
             limits)
    save(figure, path, dpi)


def save(figure, path, dpi=90):
    """Write a picture and say so."""
    figure.tight_layout()
    figure.savefig(path, dpi=dpi)
    plt.close(figure)
    print(f"  wrote {path}")


def field_picture(results, name, output, magnify, path):
    """The picture of one field at one output."""
    dim = dimension_of(results.points)
    time = f"{results.times[output]:.6g}"
    # In relaxation the time is the part of the load steps, not seconds
    title = f"{results.path.stem}, " + (f"load steps done: {100 * float(time):.6g} %"
                                        if "residual" in results.history else f"t = {time} s")
    if dim == 1:
        figure_of_fields([(results, name, title, output)], path, panel=(7.0, 3.6))
        return
    extent = np.ptp(results.points, axis=0)
    if dim == 2:
        height = np.clip(5.5 * extent[1] / extent[0], 2.5, 9.0)
        figure_of_fields([(results, name, title, output)], path, magnify=magnify,
                         panel=(7.5, height + 1.0))
        return
    figure = plt.figure(figsize=(11, 4.5))
    draw(figure, (1, 2, 1), results, name, output, title, magnify)
    cut, values, plane, label = middle_cut(results, name, output)
    axis = figure.add_subplot(1, 2, 2)
    drawn = draw_points(axis, cut, values, spacing_of(results, 3), colours_of(values), (3.5, 3.2))
    axis.set(xlabel=f"{plane[0]} [m]", ylabel=f"{plane[1]} [m]")
    axis.set_title(f"the layer next to the middle of {plane[2]}", fontsize=10)
    figure.colorbar(drawn, ax=axis, shrink=0.6, label=label)
    save(figure, path)


def middle_cut(results, name, output):
    """Points and values of the layer next to the middle of the thinnest direction, and the names of
    the axes.
    """
    values, label = values_of(results, name, output)
    extent = np.ptp(results.points, axis=0)
    thin = 2 if extent[2] <= extent[1] else int(np.argmin(extent))
    across = results.points[:, thin]
    middle = 0.5 * (across.min() + across.max())
    near = np.abs(across - middle)
    layer = near <= near.min() + 0.25 * spacing_of(results, 3)
    kept = [c for c in range(3) if c != thin]
    return results.points[layer][:, kept], values[layer], ["xyz"[c] for c in (*kept, thin)], label


def history_pictures(results, folder):
    """Energies, of explicit runs with their balance; one picture for probes, one for reactions, and
    of a relaxation one of its iterations.
    """
    h = results.history
    relaxation = "residual" in h
    if relaxation:
        # One row for each load step: too few for a line alone
        across, label, style = h["load_step"], "load step", {"marker": "o", "markersize": 3}
        figure, axes = plt.subplots(figsize=(7.5, 4.5))
        axes = [axes]
        iterations_picture(results, folder)
    else:
        across, label, style = h["time"], "time [s]", {}
        figure, axes = plt.subplots(2, 1, figsize=(7.5, 6), sharex=True, height_ratios=(3, 1))
    energies = [name for name in h
                if results.origins[name] == "run" and results.units[name] == "J"]
    for name in energies:
        if not (relaxation and name == "kinetic_energy"):
            axes[0].plot(across, h[name], label=name.replace("_", " "), **style)
    axes[0].set(ylabel="energy [J]")
    axes[0].legend(fontsize=8)
    if not relaxation:
        stored = h["kinetic_energy"] + h["strain_energy"] + h["dissipated_energy"]
        axes[1].plot(across, stored - stored[0] - h["external_work"] + h["external_work"][0])
        axes[1].set(ylabel="balance [J]")
    for axis in axes:
        axis.grid(alpha=0.3)
    finish_history(axes[-1], label, relaxation)
    save(figure, folder / "energies.png")

    reactions = [name for name in h
                 if results.origins[name] == "boundary" and results.units[name] == "N"]
    probes = [name for name in h if results.origins[name] == "probe"]
    units = {}
    for name in probes:
        units.setdefault(results.units.get(name, ""), []).append(name)
    groups = [("reactions", [("N", reactions)])] if reactions else []
    if probes:
        groups.append(("probes", list(units.items())))
    for title, panels in groups:
        figure, axes = plt.subplots(len(panels), 1, figsize=(7.5, 2.8 * len(panels) + 0.6),
                                    sharex=True, squeeze=False)
        for axis, (unit, names) in zip(axes[:, 0], panels):
            for name in names:
                axis.plot(across, h[name], linewidth=1, label=name.replace("_", " "), **style)
            axis.set(ylabel=in_brackets(unit).strip() or "[-]")
            axis.grid(alpha=0.3)
            axis.legend(fontsize=8)
        finish_history(axes[-1, 0], label, relaxation)
        save(figure, folder / f"{title}.png")


def finish_history(axis, label, relaxation):
    """The axis that the panels of a history share: time, or whole numbers of load steps."""
    axis.set(xlabel=label)
    if relaxation:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))


def iterations_picture(results, folder):
    """The way of a relaxation to its tolerance: residual and change of displacement over all
    iterations of iterations.csv. Where a load step begins there is a vertical line.
    """
    path = results.path.parent / "iterations.csv"
    if not path.is_file():
        return
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        return
    columns = {name: np.array([float(row[name]) for row in rows])
               for name in ("step", "load_step", "residual", "change")}
    figure, axis = plt.subplots(figsize=(7.5, 3.6))
    for name, label in (("residual", "residual"), ("change", "change of displacement")):
        shown = columns[name] > 0
        axis.semilogy(columns["step"][shown], columns[name][shown], linewidth=1, label=label)
    begins = np.flatnonzero(np.diff(columns["load_step"]) > 0) + 1
    for number in begins if len(begins) <= 60 else ():
        axis.axvline(columns["step"][number], color="0.7", linewidth=0.6, zorder=0)
    axis.set(xlabel="iteration, of all load steps" if len(begins) else "iteration",
             ylabel="relative [-]")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
    save(figure, folder / "iterations.png")


RESULT_COLUMNS = ("error", "seconds", "points", "bonds", "steps", "bytes", "energy_drift", "pareto",
                  "value", "true_error")


class Study:
    """The table of a study: its varied keys with their values as text, and its columns as arrays."""

    def __init__(self, path):
        self.path = Path(path)
        with open(self.path, newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        keys = len(rows[0]) - len(RESULT_COLUMNS)
        if keys < 0 or tuple(rows[0][keys:]) != RESULT_COLUMNS or len(rows) < 2:
            raise KeyError(f"{self.path} is no table of a study, or an empty one")
        self.keys = rows[0][:keys]
        self.settings = [row[:keys] for row in rows[1:]]
        self.columns = {name: np.array([float(row[keys + i]) for row in rows[1:]])
                        for i, name in enumerate(RESULT_COLUMNS)}
        # The run that others are compared with has the error 0, one without an answer none
        self.shown = np.isfinite(self.columns["error"]) & (self.columns["error"] > 0)

    def values(self, key):
        """The values of a varied key as numbers, or None if they are none."""
        try:
            return np.array([float(row[self.keys.index(key)].lower().replace("d", "e"))
                             for row in self.settings])
        except ValueError:
            return None

    def short(self, key):
        """The name of a key without its group, where no other varied key has it."""
        name = key.split("%", 1)[-1]
        same = [other for other in self.keys if other.split("%", 1)[-1] == name]
        return name if len(same) == 1 else key

    def families(self, without):
        """Numbers of runs that differ in one key alone, by a label of the others."""
        found = {}
        for number, row in enumerate(self.settings):
            if not self.shown[number]:
                continue
            label = ", ".join(f"{self.short(key)} = {value}"
                              for key, value in zip(self.keys, row) if key != without
                              and len({other[self.keys.index(key)] for other in self.settings}) > 1)
            found.setdefault(label, []).append(number)
        return found


def study_pictures(study, folder):
    """Error against time with the front, and error against each varied key."""
    error, seconds = study.columns["error"], study.columns["seconds"]
    if not study.shown.any():
        raise KeyError(f"{study.path} has no error to draw")
    # The key with most values makes the lines, one of numbers before one of words
    line = max(study.keys, key=lambda key: (study.values(key) is not None,
                                            len({row[study.keys.index(key)]
                                                 for row in study.settings})))
    figure, axis = plt.subplots(figsize=(7.5, 5))
    for label, runs in study.families(line).items():
        runs = sorted(runs, key=lambda run: seconds[run])
        axis.loglog(seconds[runs], error[runs], "o-", markersize=4, linewidth=0.8, label=label)
        for run in runs:
            axis.annotate(study.settings[run][study.keys.index(line)],
                          (seconds[run], error[run]), textcoords="offset points", xytext=(4, 3),
                          fontsize=6, color="0.4")
    front = np.flatnonzero(study.shown & (study.columns["pareto"] > 0))
    front = front[np.argsort(seconds[front])]
    axis.loglog(seconds[front], error[front], color="0.75", linewidth=5, zorder=0,
                solid_capstyle="round", label="Pareto front")
    axis.set(xlabel="time [s]", ylabel="error", title=f"the numbers are {line}")
    axis.grid(alpha=0.3, which="both")
    axis.legend(fontsize=7)
    save(figure, folder / "study_time.png")
    for key in study.keys:
        figure, axis = plt.subplots(figsize=(7.5, 4.2))
        numbers = study.values(key)
        words = sorted({row[study.keys.index(key)] for row in study.settings})
        for label, runs in study.families(key).items():
            if numbers is None:
                across = [words.index(study.settings[run][study.keys.index(key)]) for run in runs]
            else:
                runs = sorted(runs, key=lambda run: numbers[run])
                across = numbers[runs]
            axis.plot(across, error[runs], "o-" if numbers is not None else "o", markersize=4,
                      linewidth=0.8, label=label)
        axis.set_yscale("log")
        if numbers is None:
            axis.set_xticks(range(len(words)), words)
        elif (numbers > 0).all():
            axis.set_xscale("log")
        axis.set(xlabel=key, ylabel="error")
        axis.grid(alpha=0.3, which="both")
        if any(study.families(key)):
            axis.legend(fontsize=7)
            # Many lines leave no room for their names among them
            if len(study.families(key)) > 5:
                figure.set_size_inches(8.5, 6.5)
                axis.legend(fontsize=7, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1))
        save(figure, folder / f"study_{''.join(c if c.isalnum() else '_' for c in key)}.png")


def main():
    parser = argparse.ArgumentParser(prog="./pf plot", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path)
    parser.add_argument("--field", action="append", metavar="NAME",
                        help="only this field, or component as displacement_x (may be repeated)")
    parser.add_argument("--step", default="-1", metavar="N",
                        help="output number from 0, or 'all' (default: the last)")
    parser.add_argument("--magnify", type=float, default=0.0, metavar="FACTOR",
                        help="draw points moved by so many times their displacement (default 0)")
    parser.add_argument("--to", type=Path, metavar="FOLDER",
                        help="where the pictures go (default: DIR)")
    options = parser.parse_args()
    try:
        table = options.folder if options.folder.suffix == ".csv" else options.folder / "study.csv"
        if table.is_file():
            folder = options.to or table.parent
            folder.mkdir(parents=True, exist_ok=True)
            study_pictures(Study(table), folder)
            if table == options.folder or not list(options.folder.glob("*.vtkhdf")):
                return
        results = Results(options.folder)
        if options.step == "all":
            outputs = range(results.outputs)
        else:
            outputs = [range(results.outputs)[int(options.step)]]
        folder = options.to or results.path.parent
        folder.mkdir(parents=True, exist_ok=True)
        for name in options.field or results.fields:
            for output in outputs:
                field_picture(results, name, output, options.magnify,
                              folder / f"{name}_{output:04d}.png")
        if not options.field:
            history_pictures(results, folder)
    except (OSError, KeyError) as fault:
        sys.exit(f"error: {fault.args[-1] if isinstance(fault, KeyError) else fault}")
    except (ValueError, IndexError):
        sys.exit(f"error: --step {options.step} is no output's number: this file has "
                 f"{results.outputs} outputs, numbered from 0")


if __name__ == "__main__":
    main()
