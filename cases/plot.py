"""Pictures of the results in a folder.

    ./pf plot DIR [--field NAME ...] [--component C] [--time T | --step N | --step all]
                  [--clip PLANE] [--deform FACTOR] [--film [mp4 | gif]] [--compare DIR2] [--pdf]
                  [--render pyvista] [--to FOLDER]

draws what the package perifort does in app/python: fields on the deformed body and the curves of
the history. Of a study it draws error against time with the Pareto front, and error against each
varied key. DIR is the folder of the results or of the study, or the .vtkhdf or study.csv file.
"""
import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from common import Results
from perifort import pictures
from perifort.pictures.fields import View, draw_panel, draw_surface, figure_of_panels
from perifort.pictures.layout import new_figure


def draw(figure, place, results, name, output, title, magnify, window=None, limits=None):
    """One panel of a figure: a field at an output, `place`: rows, columns, number; `window`: x and
    y limits [m]; `limits`: of the colours, in SI units.
    """
    view = View(results, magnify, window=window)
    name = whole_name(results, name)
    if limits:
        view.fix_colours(name, *limits)
    axes = figure.add_subplot(*place)
    if results.dimension == 3:
        draw_surface(axes, view, name, output, bar=True)
        axes.set_title(title, fontsize=9)
    else:
        draw_panel(axes, view, name, output, title=title)


def whole_name(results, name):
    """A vector without component means its magnitude."""
    return f"{name}_magnitude" if name in results.fields and results.components[name] else name


def figure_of_fields(items, path, columns=1, magnify=0.0, width=5.0, window=None,
                     limits=None, dpi=80):
    """One picture of several panels, each (results, field, title) or (results, field, title,
    output), and `width` inches wide.
    """
    shown = []
    for results, name, title, *output in items:
        view = View(results, magnify, window=window)
        name = whole_name(results, name)
        if limits:
            view.fix_colours(name, *limits)
        shown.append((view, name, output[0] if output else -1, title))
    save(figure_of_panels(shown, columns, width), path, dpi)


def save(figure, path, dpi=90):
    """Write a picture and say so."""
    if figure.get_layout_engine() is None:
        figure.tight_layout()
    pictures.save(figure, Path(path), dpi)


def small_film(results, field, path, width=480, colours=32, every=1):
    """A gif of every so many-th frame of the film that `./pf plot --film gif` makes, so many points
    wide and with few colours: small enough for a page. Pillow comes with matplotlib.
    """
    from PIL import Image
    made, = results.plot(field=field, film="gif", to=results.folder, quiet=True)
    with Image.open(made) as film:
        size = (width, round(width * film.height / film.width))
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(film.convert("RGB").resize(size, Image.Resampling.LANCZOS))
    # The last frame is kept, which has all colours
    frames = frames[(len(frames) - 1) % every::every]
    palette = frames[-1].quantize(colours, dither=Image.Dither.NONE)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=200 * every, loop=0)
    print(f"  wrote {path}")


RESULT_COLUMNS = ("error", "seconds", "points", "bonds", "steps", "bytes", "energy_drift", "pareto",
                  "value", "true_error")


class Study:
    """The table of a study: its varied keys with their values as text, and its columns as arrays.
    """

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


def study_pictures(study, folder, ending="png"):
    """Error against time with the front, and error against each varied key."""
    error, seconds = study.columns["error"], study.columns["seconds"]
    if not study.shown.any():
        raise KeyError(f"{study.path} has no error to draw")
    # The key with most values makes the lines, one of numbers before one of words
    line = max(study.keys, key=lambda key: (study.values(key) is not None,
                                            len({row[study.keys.index(key)]
                                                 for row in study.settings})))
    figure = new_figure(7.5, 5)
    axis = figure.subplots()
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
    save(figure, folder / f"study_time.{ending}")
    for key in study.keys:
        figure = new_figure(7.5, 4.2)
        axis = figure.subplots()
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
        save(figure, folder / f"study_{''.join(c if c.isalnum() else '_' for c in key)}.{ending}")


def seconds(text):
    """A time in seconds, or with a unit: 2e-5, 20us, 0.02ms; in statics a load factor."""
    for unit, size in (("us", 1e-6), ("\u00b5s", 1e-6), ("ms", 1e-3), ("ns", 1e-9), ("s", 1.0)):
        if text.endswith(unit):
            return float(text[:-len(unit)]) * size
    return float(text)


def main():
    parser = argparse.ArgumentParser(prog="./pf plot", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path)
    parser.add_argument("--field", action="append", metavar="NAME",
                        help="only this field, or component as displacement_x (may be repeated)")
    parser.add_argument("--component", metavar="C",
                        help="only this component, as y or xy, or magnitude")
    parser.add_argument("--time", type=seconds, metavar="T",
                        help="the output nearest to this time, as 2e-5 or 20us, or load factor")
    parser.add_argument("--step", metavar="N",
                        help="output number from 0, or 'all' (default: the last)")
    parser.add_argument("--clip", metavar="PLANE", help="cut of a 3D body: x, y, z, or y=0.01 [m]")
    parser.add_argument("--deform", type=float, metavar="FACTOR",
                        help="factor of the drawn displacements (default: one that shows them)")
    parser.add_argument("--film", nargs="?", const="mp4", choices=("mp4", "gif"),
                        help="a film of all outputs")
    parser.add_argument("--compare", type=Path, metavar="DIR2", help="beside the results in DIR2")
    parser.add_argument("--pdf", action="store_true", help="files for print")
    parser.add_argument("--render", choices=("matplotlib", "pyvista"), default="matplotlib",
                        help="what draws the surface of a 3D body")
    parser.add_argument("--to", type=Path, metavar="FOLDER",
                        help="where the pictures go (default: DIR)")
    options = parser.parse_args()
    try:
        plot(options)
    except (OSError, KeyError, ImportError) as fault:
        sys.exit(f"error: {fault.args[-1] if isinstance(fault, KeyError) else fault}")
    except (ValueError, IndexError) as fault:
        sys.exit(f"error: {fault}")


def plot(options):
    """What the options ask for."""
    table = options.folder if options.folder.suffix == ".csv" else options.folder / "study.csv"
    if table.is_file():
        folder = options.to or table.parent
        folder.mkdir(parents=True, exist_ok=True)
        study_pictures(Study(table), folder, "pdf" if options.pdf else "png")
        if table == options.folder or not list(options.folder.glob("*.vtkhdf")):
            return
    step = options.step
    if step is not None and step != "all":
        try:
            step = int(step)
        except ValueError:
            raise ValueError(f"--step {step} is no output's number: expected a whole number or "
                             "'all'") from None
    results = Results(options.folder)
    shared = {"field": options.field, "component": options.component, "time": options.time,
              "output": step, "clip": options.clip, "deform": options.deform, "pdf": options.pdf,
              "render": options.render, "to": options.to}
    if options.compare:
        if options.film or step == "all":
            raise ValueError("--compare draws one output: leave out --film and --step all")
        pictures.compare_results(results, Results(options.compare), **shared)
    else:
        pictures.plot_results(results, film=options.film, **shared)


if __name__ == "__main__":
    main()
