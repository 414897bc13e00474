"""Pictures and films of results. `plot_results` makes what `./pf plot DIR` does."""
from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Union

from ..results import Quantity, Results

try:
    import matplotlib as _needed
except ImportError as fault:
    raise ImportError("pictures need the package matplotlib: pip install matplotlib") from fault
del _needed

import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from .colours import colours_of  # noqa: E402
from .curves import curve_pictures  # noqa: E402
from .fields import (Clip, View, base_name, draw_panel, draw_surface, figure_of,  # noqa: E402
                     figure_of_panels, names_of, values_of, worth_drawing)
from .film import write_film  # noqa: E402
from .layout import FONT, Panel, lay_out  # noqa: E402
from .units import state_text  # noqa: E402

__all__ = ["Clip", "View", "compare_results", "draw_panel", "draw_surface", "figure_of",
           "plot_results", "save", "values_of", "worth_drawing", "write_film"]

PathLike = Union[str, "os.PathLike[str]"]


def plot_results(results: Results, *, field: str | Sequence[str] | None = None,
                 component: str | None = None, time: float | None = None,
                 output: int | str | None = None, clip: str | None = None,
                 deform: float | None = None, film: str | None = None, pdf: bool = False,
                 render: str = "matplotlib", to: PathLike | None = None, curves: bool | None = None,
                 quiet: bool = False) -> list[Path]:
    """Draw results and return the paths of the pictures.

    `field`: only this field (or component, `stress_xy`), or these; by default all that say
    something, and the curves of the history (`curves`: always or never). `component`: only this
    component, or `magnitude`. `time` [s], in statics a load factor, or `output`, its number or
    'all': by default the last one. `clip`: the plane of the cut in 3D, `y` or `y=0.01`. `deform`:
    the factor of the drawn displacements, by default one that shows them. `film`: 'mp4' or 'gif', a
    film of all outputs of the fields, by default of one. `pdf`: files for print. `render`:
    'pyvista' for surfaces drawn by it. `to`: the folder, by default that of the results.
    """
    view = View(results, deform, Clip.parse(clip) if clip else None, render)
    if film and (time is not None or output is not None):
        raise ValueError("a film shows all outputs: leave out the time and the output")
    numbers = list(_outputs(results, time, output))
    fields = _fields(results, field, component, quiet, most=1 if film else None)
    folder = _folder(results, to)
    made = []
    if film:
        if film not in ("mp4", "gif"):
            raise ValueError(f"'{film}' is no kind of film: expected mp4 or gif")
        for name in fields:
            parts = names_of(results, name, component)
            path = folder / f"{_file(name, component)}.{film}"
            view.steady = True

            def frame(k: int, parts: list[str] = parts) -> Figure:
                return figure_of(view, parts, k)
            made.append(_told(write_film(path, results.outputs, frame), quiet))
        return made
    ending = "pdf" if pdf else "png"
    for k in numbers:
        for name in fields:
            figure = figure_of(view, names_of(results, name, component), k)
            made.append(save(figure, folder / f"{_file(name, component)}_{k:04d}.{ending}",
                             quiet=quiet))
    if curves or (curves is None and not field and not component):
        for name, figure in curve_pictures([results]).items():
            made.append(save(figure, folder / f"{name}.{ending}", quiet=quiet))
    return made


def compare_results(results: Results, other: Results, *,
                    field: str | Sequence[str] | None = None, component: str | None = None,
                    time: float | None = None, output: int | None = None, clip: str | None = None,
                    deform: float | None = None, pdf: bool = False, render: str = "matplotlib",
                    to: PathLike | None = None, quiet: bool = False) -> list[Path]:
    """Two runs beside each other with the same colours, and their difference where they have the
    same points; their histories in the same curves. Options as of `plot_results`.
    """
    cut = Clip.parse(clip) if clip else None
    first = View(results, deform, cut, render)
    # Both with the displacements of the first at the same scale
    second = View(other, first.scale, cut, render)
    folder = _folder(results, to)
    ending = "pdf" if pdf else "png"
    k = results.number(output, time)
    # The same moment of the other run, if it has one
    value = float(results.times[k])
    inside = other.times.min() <= value <= other.times.max()
    j = other.number(time=value) if inside else other.outputs - 1
    same = (results.points.shape == other.points.shape
            and bool(np.allclose(results.points, other.points, rtol=0,
                                 atol=1e-6 * first.spacing)))
    if results.dimension != other.dimension:
        raise ValueError(f"{results.name} has {results.dimension} dimensions, {other.name} "
                         f"{other.dimension}")
    made = []
    names = list(dict.fromkeys([results.name, other.name]))
    if len(names) == 1:
        names = [str(results.folder), str(other.folder)]
    for name in _fields(results, field, component, quiet):
        base = results.split(base_name(name))[0]
        if base not in other.fields:
            if not quiet:
                print(f"  left out: {name} ({other.path.name} has none)")
            continue
        parts = names_of(results, name, component)
        first.share_colours([second], parts)
        # Numbers of fragments have no difference
        figure = _comparison(first, second, parts, k, j, same and base != "fragment", names)
        path = folder / f"compared_{_file(name, component)}_{k:04d}.{ending}"
        made.append(save(figure, path, quiet=quiet))
    if not field and not component:
        for name, figure in curve_pictures([results, other]).items():
            made.append(save(figure, folder / f"compared_{name}.{ending}", quiet=quiet))
    return made


def _comparison(first: View, second: View, parts: Sequence[str], k: int, j: int, same: bool,
                names: Sequence[str]) -> Figure:
    """A row for each component: the two runs and their difference."""
    results, other = first.results, second.results
    if results.dimension == 1:
        figure, rows = lay_out([[Panel(0.45, bar="")] for _ in parts], 5.0, caption=False)
        for part, (place,) in zip(parts, rows):
            assert place is not None
            draw_panel(place.axes, first, part, k)
            low, high = place.axes.get_ylim()
            draw_panel(place.axes, second, part, j)
            place.axes.set_ylim(min(low, place.axes.get_ylim()[0]),
                                max(high, place.axes.get_ylim()[1]))
            place.axes.legend(place.axes.get_lines(), names, fontsize=FONT - 1)
        return figure
    items = []
    for part in parts:
        for view, at, named in ((first, k, names[0]), (second, j, names[1])):
            items.append((view, part, at, f"{named}, {state_text(view.results, at)}"))
        if same:
            difference = _Difference(results, other, part, k, j)
            view = View(difference, first.scale, first.clip, first.render)
            view.take_colours(part, colours_of(
                "difference", [np.asarray(difference.field(base_name(part)))[results.body]]))
            items.append((view, part, k, "second less first"))
    caption = f"displacements \u00d7 {first.scale:.6g}" if first.scale not in (0.0, 1.0) else ""
    return figure_of_panels(items, 3 if same else 2, 3.3, caption)


class _Difference(Results):
    """A field of a second run less that of a first one, as results with one output."""

    def __init__(self, first: Results, second: Results, name: str, k: int, j: int) -> None:
        self.__dict__.update(first.__dict__)
        self._only = np.asarray(values_of(second, name, j) - values_of(first, name, k))
        self._named, self._first, self._at = name, first, k
        if first.cells is not None and second.cells is not None and \
                np.array_equal(first.cells.connectivity, second.cells.connectivity):
            self._of_cells = np.asarray(values_of(second, name, j, "cells")
                                        - values_of(first, name, k, "cells"))
        else:
            self.cells = None

    def field(self, name: str, output: float | None = None, *, time: float | None = None,
              of: str = "points") -> Quantity:
        """The difference, at any output; the displacements are those of the first run."""
        if name == base_name(self._named) and of != "nodes":
            return Quantity(self._of_cells if of == "cells" else self._only,
                            self.field_units[self.split(name)[0]], name)
        return self._first.field(name, self._at, of=of)


def _fields(results: Results, field: str | Sequence[str] | None, component: str | None, quiet: bool,
            most: int | None = None) -> list[str]:
    """The fields to draw: those asked for, else all that say something, of these the first `most`.
    """
    if field:
        asked = [field] if isinstance(field, str) else list(field)
        for name in asked:
            results.split(base_name(name))
        return asked
    shown, left = worth_drawing(results)
    if component:
        # Fields without it are not meant
        have = [name for name in results.fields if results.components[name]
                and component in (*results.components[name], "magnitude")]
        if not have:
            raise KeyError(f"no field of {results.path.name} has a component '{component}'")
        shown = [name for name in shown if name in have]
    if left and not quiet:
        print("  left out: " + ", ".join(f"{name} ({why})" for name, why in left.items()))
    if most and shown:
        # A crack says most, then what spreads
        first = next((name for name in ("damage", "von_mises", "velocity", "displacement")
                      if name in shown), shown[0])
        return [first]
    return shown


def _outputs(results: Results, time: float | None, output: int | str | None) -> Iterable[int]:
    """The numbers of the outputs to draw."""
    if output == "all":
        return range(results.outputs)
    if output is not None and time is not None:
        raise ValueError("an output is named by its number or by its time, not by both")
    return [results.number(None if output is None else int(output), time)]


def _file(name: str, component: str | None) -> str:
    """The name of a picture's file."""
    return f"{name}_{component}" if component and not name.endswith(f"_{component}") else name


def _folder(results: Results, to: PathLike | None) -> Path:
    """Where pictures go."""
    folder = Path(to) if to else results.folder
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def save(figure: Figure, path: Path, dpi: float = 150.0, quiet: bool = False) -> Path:
    """Write a picture, without empty margins, and say so."""
    if path.suffix == ".pdf":
        dpi *= 2.0  # of cells, which are pixels in a file of lines
    figure.savefig(path, dpi=dpi, bbox_inches="tight", pad_inches=0.06, facecolor="white")
    return _told(path, quiet)


def _told(path: Path, quiet: bool) -> Path:
    """Say that a file was written."""
    if not quiet:
        print(f"  wrote {path}")
    return path
