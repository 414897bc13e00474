"""Panels of fields: a curve in 1D, deformed cells in 2D, a lit surface and a cut in 3D."""
from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..reference import nearest
from ..results import Results
from .cells import Lattice, Part, best_cut, lattice_of, parts_of, quads, spacing_of
from .colours import Colours, colours_of, limits_of, nice_scale, sampled
from .units import Scale, number, scale_of, state_text, words

Array = npt.NDArray[Any]
FONT = 8.0
# More cells than this are drawn as an image of them, which no eye can tell apart
MOST_CELLS = 600000
Window = Sequence[Sequence[float]]


@dataclass(frozen=True)
class Clip:
    """The plane of a cut: normal to an axis, at a position [m], None for the middle of the body."""

    axis: int
    at: float | None = None

    @classmethod
    def parse(cls, text: str) -> Clip:
        """From `y` or `y=0.01`."""
        name, _, position = text.partition("=")
        if name.strip().lower() not in ("x", "y", "z"):
            raise ValueError(f"'{text}' is no cut: expected x, y or z, or y=0.01 with a position [m]")
        try:
            return cls("xyz".index(name.strip().lower()), float(position) if position else None)
        except ValueError:
            raise ValueError(f"'{text}' is no cut: '{position}' is no position [m]") from None


@dataclass
class View:
    """What all pictures of a run share: parts of the body, the scale of displacements, colours."""

    results: Results
    deform: float | None = None
    clip: Clip | None = None
    render: str = "matplotlib"
    window: Window | None = None
    _colours: dict[str, Colours] = field(default_factory=dict)

    @cached_property
    def parts(self) -> list[Part]:
        """The points of the body, without layers."""
        return parts_of(self.results)

    @cached_property
    def spacing(self) -> float:
        """The largest size of a cell."""
        return float(max(part.sizes.max() for part in self.parts))

    @cached_property
    def scale(self) -> float:
        """The factor of the drawn displacements."""
        r = self.results
        if self.deform is not None or "displacement" not in r.fields or r.dimension == 1:
            return (self.deform or 0.0) if "displacement" in r.fields else 0.0
        largest = max(float(np.abs(r.field("displacement", k)[r.body]).max())
                      for k in sampled(r)) if r.outputs else 0.0
        return nice_scale(largest, float(np.ptp(r.points[r.body], axis=0).max()))

    def positions(self, output: int) -> Array:
        """Positions (n, 3) as they are drawn."""
        if not self.scale:
            return self.results.points
        moved = self.results.field("displacement", output)
        return np.asarray(self.results.points + self.scale * np.asarray(moved))

    def colours(self, name: str) -> Colours:
        """The colours of a field or component, over all outputs."""
        if name not in self._colours:
            base = self.results.split(base_name(name))[0]
            parts = [values_of(self.results, name, k)[self.results.body]
                     for k in sampled(self.results)]
            self._colours[name] = colours_of(base, parts)
        return self._colours[name]

    def range(self, name: str) -> tuple[float, float]:
        """The smallest and largest value over all outputs, for curves."""
        parts = [values_of(self.results, name, k)[self.results.body] for k in sampled(self.results)]
        return limits_of(parts, robust=False)[2:]

    def share_colours(self, others: Sequence[View], names: Sequence[str]) -> None:
        """Give all views the same colours, those over the outputs of all."""
        for name in names:
            parts = [values_of(view.results, name, k)[view.results.body] for view in (self, *others)
                     for k in sampled(view.results)]
            shared = colours_of(self.results.split(base_name(name))[0], parts)
            for view in (self, *others):
                view._colours[name] = shared

    def caption(self, output: int) -> str:
        """What the picture shows: `slow, t = 9.44 us, displacements x 20`."""
        r = self.results
        text = f"{r.name}, {state_text(r, output)}"
        if r.dimension > 1 and self.scale == 1.0:
            text += ", displacements to scale"
        elif r.dimension > 1 and self.scale:
            text += f", displacements \u00d7 {number(self.scale)}"
        return text


def base_name(name: str) -> str:
    """A field without the word for its magnitude."""
    return name[:-len("_magnitude")] if name.endswith("_magnitude") else name


def values_of(results: Results, name: str, output: int = -1) -> Array:
    """Values (n) of a field, of a component of it ('displacement_x', 'stress_xy'), or the magnitude
    of a vector or tensor ('displacement_magnitude').
    """
    base = base_name(name)
    values = np.asarray(results.field(base, output), dtype=float)
    if values.ndim == 2:
        # Components off the diagonal of a symmetric tensor stand for two each
        names = results.components[results.split(base)[0]]
        times = [2 if len(set(c)) == 2 and c[::-1] not in names else 1 for c in names]
        values = np.sqrt((values**2) @ np.asarray(times, dtype=float))
    return values


def label_of(results: Results, name: str) -> str:
    """The name of a field, component or magnitude as a colour bar has it, without unit."""
    base, component = results.split(base_name(name))
    if component is not None:
        return f"{words(base)} {results.components[base][component]}"
    return f"|{words(base)}|" if results.components[base] else words(base)


def unit_of(results: Results, name: str) -> str:
    """The unit of a field or component."""
    return results.field_units[results.split(base_name(name))[0]]


def names_of(results: Results, name: str, component: str | None = None) -> list[str]:
    """What is drawn of a field: a scalar, the components that are not zero, or the one asked for."""
    base, given = results.split(base_name(name))
    parts = results.components[base]
    if given is not None or name != base or not parts:
        if component and not (given is not None and parts[given] == component):
            if not parts:
                raise KeyError(f"the field '{base}' has no components")
            raise KeyError(f"'{name}' is not the component {component}")
        return [name]
    if component:
        if component not in (*parts, "magnitude"):
            raise KeyError(f"'{base}' has no component '{component}'{nearest(component, parts)}; it "
                           f"has {', '.join(parts)}, and magnitude")
        return [f"{base}_{component}"]
    largest = np.zeros(len(parts))
    for k in sampled(results):
        values = np.asarray(results.field(base, k))[results.body]
        with np.errstate(invalid="ignore"):
            largest = np.fmax(largest, np.abs(np.where(np.isfinite(values), values, 0.0)).max(axis=0))
    # Directions the body does not have
    absent = ["xyz".index(part) >= results.dimension if part in "xyz" else False for part in parts]
    shown = [f"{base}_{part}" for part, size, none in zip(parts, largest, absent)
             if size > 1e-6 * largest.max() and not none]
    return shown or [f"{base}_{parts[0]}"]


def worth_drawing(results: Results) -> tuple[list[str], dict[str, str]]:
    """The fields that say something, and those that do not with the reason."""
    shown, left = [], {}
    for name in results.fields:
        values = [np.asarray(results.field(name, k))[results.body] for k in sampled(results)]
        if results.static and name == "velocity":
            left[name] = "statics have none"
        elif not any(np.any(np.nan_to_num(part)) for part in values):
            left[name] = "zero"
        elif name == "fragment" and all(np.all(part == part[0]) for part in values):
            left[name] = "the body is one piece"
        else:
            shown.append(name)
    return shown, left


# Panels

def draw_panel(axes: Axes, view: View, name: str, output: int, *, bar: bool = True,
               title: str = "", window: Window | None = None) -> None:
    """One field or component at one output, of a body in 1D or 2D, with its colour bar."""
    results = view.results
    values = values_of(results, name, output)
    if results.dimension == 1:
        _draw_line(axes, view, name, values)
    else:
        colours = view.colours(name)
        scale = scale_of(unit_of(results, name), [colours.low, colours.high])
        positions = view.positions(output)
        _draw_cells(axes, [(part, positions[part.points], values[part.points])
                           for part in view.parts], colours, scale.factor)
        _frame(axes, view, positions[results.body], window or view.window)
        if bar:
            add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)))
    if title:
        axes.set_title(title, fontsize=FONT + 1)


def _draw_line(axes: Axes, view: View, name: str, values: Array) -> None:
    """The values along a bar with their sign. The range is that of all outputs."""
    results = view.results
    body = np.flatnonzero(results.body)
    order = body[np.argsort(results.points[body, 0])]
    low, high = view.range(name)
    along = scale_of("m", results.points[body, 0])
    scale = scale_of(unit_of(results, name), [low, high])
    axes.plot(along.factor * results.points[order, 0], scale.factor * values[order], linewidth=1.2,
              marker="." if len(order) <= 60 else "", markersize=3)
    room = 0.05 * (high - low) * scale.factor
    if high - low > 1e-6 * max(abs(low), abs(high)):
        axes.set_ylim(scale.factor * low - room, scale.factor * high + room)
    else:
        # The same everywhere: not the noise of it
        axes.set_ylim(min(0.0, 2.0 * scale.factor * high), max(0.0, 2.0 * scale.factor * high) or 1.0)
    axes.set_xlabel(along.label("x"), fontsize=FONT)
    axes.set_ylabel(scale.label(label_of(results, name)), fontsize=FONT)
    axes.grid(alpha=0.3)
    tidy(axes)


def _draw_cells(axes: Axes, parts: Sequence[tuple[Part, Array, Array]], colours: Colours,
                factor: float) -> None:
    """Cells as polygons without edges that overlap by a hair, so that no lines stay between them;
    many cells as an image.
    """
    norm = Normalize(factor * colours.low, factor * colours.high)
    cmap = _map(colours)
    for part, positions, values in parts:
        if len(values) > MOST_CELLS:
            _draw_image(axes, part, positions, factor * values, norm, cmap,
                        colours.map == "magma_r")
            continue
        corners = quads(part, positions)
        middle = corners.mean(axis=1, keepdims=True)
        # Two in a hundred: less than is seen, more than rounding to pixels leaves open
        drawn = PolyCollection(middle + 1.02 * (corners - middle), array=factor * values, cmap=cmap,
                               norm=norm, linewidths=0, antialiaseds=False, rasterized=True)
        axes.add_collection(drawn)


def _draw_image(axes: Axes, part: Part, positions: Array, values: Array, norm: Normalize,
                cmap: Any, largest: bool) -> None:
    """Cells as pixels of about their size: means of what falls into one, of damage the largest."""
    size = float(np.median(part.sizes))
    low = positions[:, :2].min(axis=0) - size / 2
    span = positions[:, :2].max(axis=0) + size / 2 - low
    pixel = max(size, float(span.max()) / 1500)
    counts = np.maximum(np.ceil(span / pixel - 1e-6).astype(int), 1)
    at = np.minimum(((positions[:, :2] - low) / pixel).astype(int), counts - 1)
    line = at[:, 1] * counts[0] + at[:, 0]
    number_of = np.bincount(line, minlength=int(counts.prod()))
    if largest:
        image: Array = np.full(int(counts.prod()), -np.inf)
        np.maximum.at(image, line, values)
    else:
        image = np.bincount(line, values, int(counts.prod())) / np.maximum(number_of, 1)
    image = np.where(number_of > 0, image, np.nan).reshape(counts[1], counts[0])
    # A stretched body leaves pixels between its cells empty
    for axis in (0, 1):
        before, after = np.roll(image, 1, axis), np.roll(image, -1, axis)
        gap = np.isnan(image) & ~np.isnan(before) & ~np.isnan(after)
        image[gap] = 0.5 * (before[gap] + after[gap])
    cmap = cmap.copy()
    cmap.set_bad(alpha=0.0)
    axes.imshow(np.ma.masked_invalid(image), origin="lower", cmap=cmap, norm=norm,
                extent=(low[0], low[0] + counts[0] * pixel, low[1], low[1] + counts[1] * pixel),
                interpolation="nearest")


def _frame(axes: Axes, view: View, positions: Array, window: Window | None) -> None:
    """Equal axes in a unit that reads well, around the body and what has not flown far from it."""
    rest = view.results.points[view.results.body]
    half = view.spacing / 2
    limits = []
    for c in (0, 1):
        low, high = rest[:, c].min(), rest[:, c].max()
        room = 0.6 * max(np.ptp(rest[:, 0]), np.ptp(rest[:, 1]))
        limits.append((float(max(positions[:, c].min(), low - room) - half),
                       float(min(positions[:, c].max(), high + room) + half)))
    if window is not None:
        limits = [(float(window[c][0]), float(window[c][1])) for c in (0, 1)]
    else:
        margin = 0.015 * max(end - begin for begin, end in limits)
        limits = [(begin - margin, end + margin) for begin, end in limits]
    _label(axes, "xy", limits)


def _label(axes: Axes, names: str, limits: Sequence[tuple[float, float]]) -> Scale:
    """Limits, ticks and names of equal axes in a length that reads well, which is returned. Ticks are
    round in that unit, and fewer on short sides, where their numbers would overlap.
    """
    axes.set(xlim=limits[0], ylim=limits[1], aspect="equal")
    scale = scale_of("m", limits)
    longest = max(high - low for low, high in limits)
    for ticks, (low, high) in zip((axes.xaxis, axes.yaxis), limits):
        count = int(np.clip(round(6 * (high - low) / longest), 2, 6))
        low, high = low * scale.factor, high * scale.factor
        at = np.asarray(MaxNLocator(count, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        at = at[(at >= low) & (at <= high)]
        if (high - low) / scale.factor < 0.2 * longest and len(at) > 2:
            at = at[[0, -1]]
        ticks.set_ticks(at / scale.factor, labels=[f"{value:.6g}" for value in at])
    axes.set_xlabel(scale.label(names[0]), fontsize=FONT)
    axes.set_ylabel(scale.label(names[1]), fontsize=FONT)
    axes.tick_params(labelsize=FONT - 1)
    return scale


def tidy(axes: Axes) -> None:
    """Small numbers at the ticks, and few of them; an offset would read as part of the unit."""
    axes.tick_params(labelsize=FONT - 1)
    for ticks in (axes.xaxis, axes.yaxis):
        if ticks.get_scale() == "linear":
            ticks.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axes.ticklabel_format(useOffset=False) if axes.get_yscale() == "linear" else None


def _map(colours: Colours) -> Any:
    """The colour map; where a value is missing it is grey."""
    cmap = mpl.colormaps[colours.map].copy()
    cmap.set_bad("0.8")
    return cmap


def add_bar(axes: Axes, colours: Colours, factor: float, label: str,
            wide: bool | None = None) -> None:
    """A colour bar as long as the panel: beside it, or below wide ones. It says if the colours do not
    cover all values.
    """
    figure = axes.figure
    limits = axes.get_xlim(), axes.get_ylim()
    if wide is None:
        wide = (limits[0][1] - limits[0][0]) > 2.2 * (limits[1][1] - limits[1][0])
    norm = Normalize(factor * colours.low, factor * colours.high)
    shown = ScalarMappable(norm=norm, cmap=_map(colours))
    bar = figure.colorbar(shown, ax=axes, extend=colours.extend,
                          orientation="horizontal" if wide else "vertical",
                          fraction=0.08 if wide else 0.046, pad=0.03, aspect=30 if wide else 22,
                          extendfrac=0.03)
    bar.set_label(label + (f"\n{colours.note}" if colours.note else ""), fontsize=FONT)
    bar.ax.tick_params(labelsize=FONT - 1)
    bar.locator = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    bar.outline.set_linewidth(0.5)


# Three dimensions

class Camera:
    """A parallel view from an angle: right, up and towards the eye."""

    def __init__(self, azimuth: float = -55.0, elevation: float = 25.0) -> None:
        a, e = np.radians([azimuth, elevation])
        self.eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self.right = np.array([-np.sin(a), np.cos(a), 0.0])
        self.up = np.cross(self.eye, self.right)
        light = 0.55 * self.eye + 0.7 * self.up - 0.45 * self.right
        self.light = light / np.linalg.norm(light)

    def flat(self, points: Array) -> Array:
        """Positions in the picture (.., 2)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)


def camera_for(points: Array) -> Camera:
    """Flat bodies are seen from higher above."""
    extents = np.ptp(points, axis=0)
    flat = extents[2] < 0.25 * min(extents[0], extents[1])
    return Camera(elevation=50.0 if flat else 25.0)


def surface_of(view: View, name: str, output: int, camera: Camera,
               clip: Clip | None) -> tuple[Array, Array]:
    """The outer faces (n, 4, 3) of the deformed body and their values; what lies in front of the cut
    is left out. Points of clouds are small squares that face the eye.
    """
    results = view.results
    values = values_of(results, name, output)
    positions = view.positions(output)
    found, shades = [], []
    for part in view.parts:
        kept = np.ones(len(part.points), dtype=bool)
        if clip is not None:
            plane = position_of(view, clip)
            before = results.points[part.points, clip.axis] - plane
            kept = before * np.sign(camera.eye[clip.axis]) <= 0.01 * view.spacing
        if part.lattice is None:
            half = 0.5 * part.sizes[kept, None, None] * np.array(
                [-camera.right - camera.up, camera.right - camera.up, camera.right + camera.up,
                 camera.up - camera.right])
            found.append(positions[part.points[kept]][:, None] + half)
            shades.append(values[part.points[kept]])
            continue
        faces = part.lattice.faces(kept)
        used = np.unique(np.concatenate([cells for cells, _ in faces]))
        row = np.full(len(part.points), -1)
        row[used] = np.arange(len(used))
        corners = part.lattice.corners(positions[part.points], used)
        for cells, around in faces:
            found.append(corners[row[cells]][:, around])
            shades.append(values[part.points[cells]])
    return np.concatenate(found), np.concatenate(shades)


def position_of(view: View, clip: Clip) -> float:
    """Where the plane of a cut is: as given, or in the middle of the body."""
    along = view.results.points[view.results.body, clip.axis]
    middle = 0.5 * float(along.min() + along.max())
    if clip.at is None:
        return middle
    if not along.min() - view.spacing / 2 <= clip.at <= along.max() + view.spacing / 2:
        raise ValueError(f"the cut at {'xyz'[clip.axis]} = {clip.at:g} m misses the body, which lies "
                         f"between {along.min():.6g} and {along.max():.6g} m")
    return clip.at


def draw_surface(axes: Axes, view: View, name: str, output: int, clip: Clip | None = None,
                 bar: bool = False) -> None:
    """The body as a lit surface. With `clip` what lies in front of the cut is taken off."""
    results = view.results
    colours = view.colours(name)
    camera = camera_for(results.points[results.body])
    quad, values = surface_of(view, name, output, camera, clip)
    flat = camera.flat(quad)
    if view.render == "pyvista":
        from .rendered import render
        image, extent = render(quad, values, colours, camera)
        axes.imshow(image, extent=extent, interpolation="antialiased")
    else:
        normal = np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        seen = normal @ camera.eye > -1e-9
        flat, normal, depth = flat[seen], normal[seen], (quad[seen].mean(axis=1) @ camera.eye)
        norm = Normalize(colours.low, colours.high)
        rgba = _map(colours)(norm(np.ma.masked_invalid(values[seen])))
        rgba[:, :3] *= (0.5 + 0.5 * np.clip(normal @ camera.light, 0.0, 1.0))[:, None]
        order = np.argsort(depth)
        # Edges in the colour of the face close the hairlines between faces
        axes.add_collection(PolyCollection(flat[order], facecolors=rgba[order],
                                           edgecolors=rgba[order], linewidths=0.3, rasterized=True))
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    room = 0.04 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room),
             aspect="equal")
    axes.set_axis_off()
    _triad(axes, camera)
    if bar:
        scale = scale_of(unit_of(results, name), [colours.low, colours.high])
        add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)))


def _triad(axes: Axes, camera: Camera) -> None:
    """The directions x, y, z in the lower left corner, of one size in all pictures."""
    for axis, name in enumerate("xyz"):
        x, y = 17.0 * camera.flat(np.eye(3)[axis])
        axes.annotate(name, (0.03, 0.03), (float(x), float(y)), xycoords="axes fraction",
                      textcoords="offset points", fontsize=FONT - 1, ha="center", va="center",
                      annotation_clip=False,
                      arrowprops={"arrowstyle": "<-", "linewidth": 0.7, "shrinkA": 1, "shrinkB": 0})


def draw_cut(axes: Axes, view: View, name: str, output: int, clip: Clip, bar: bool = True) -> None:
    """The layer of cells that a plane cuts, seen along its normal, with equal axes."""
    results = view.results
    values = values_of(results, name, output)
    positions = view.positions(output)
    plane = position_of(view, clip)
    # x to the right where it lies in the plane, z upwards
    shown = [c for c in range(3) if c != clip.axis]
    parts = []
    for part in view.parts:
        apart = np.abs(results.points[part.points, clip.axis] - plane)
        near = np.flatnonzero(apart <= part.sizes / 2 * (1 + 1e-6))
        if not len(near):
            continue
        if part.lattice is not None:
            # A plane between two layers takes one of them
            layer = part.lattice.place[near, clip.axis]
            near = near[layer == layer.min()]
            flat = Lattice(part.lattice.place[near][:, shown], part.lattice.spacing)
        else:
            flat = None
        cut = Part(part.points[near], part.sizes[near], flat)
        parts.append((cut, positions[cut.points][:, shown], values[cut.points]))
    colours = view.colours(name)
    scale = scale_of(unit_of(results, name), [colours.low, colours.high])
    _draw_cells(axes, parts, colours, scale.factor)
    every = np.concatenate([place for _, place, _ in parts])
    half = 0.52 * view.spacing
    limits = [(float(every[:, c].min() - half), float(every[:, c].max() + half)) for c in (0, 1)]
    margin = 0.02 * max(high - low for low, high in limits)
    limits = [(low - margin, high + margin) for low, high in limits]
    unit = _label(axes, "".join("xyz"[c] for c in shown), limits)
    plane = 0.0 if abs(plane) < 1e-6 * view.spacing else plane
    axes.set_title(f"cut at {'xyz'[clip.axis]} = {number(plane * unit.factor)} {unit.text}",
                   fontsize=FONT)
    if bar:
        add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)))


def clip_for(view: View, name: str) -> Clip:
    """The cut that was asked for, or the plane through the middle that shows how the field varies."""
    if view.clip is not None:
        return view.clip
    results = view.results
    last = values_of(results, name, -1)[results.body]
    return Clip(best_cut(results, last, results.points[results.body]))


# Pictures

def figure_of(view: View, names: Sequence[str], output: int, caption: str | None = None) -> Figure:
    """One picture of one field: a panel for each of the names, its components, at one output."""
    dimension = view.results.dimension
    count = len(names)
    caption = view.caption(output) if caption is None else caption
    if dimension == 1:
        figure = new_figure(5.0, 2.6 * count)
        for row, name in enumerate(names):
            draw_panel(figure.add_subplot(count, 1, row + 1), view, name, output)
    elif dimension == 2:
        columns, rows, width, height = arrange(view, output, count)
        figure = new_figure(width * columns, height * rows + 0.3)
        for place, name in enumerate(names):
            draw_panel(figure.add_subplot(rows, columns, place + 1), view, name, output)
    else:
        figure = _solid_figure(view, names, output)
    figure.suptitle(caption, fontsize=FONT + 1)
    return figure


def _solid_figure(view: View, names: Sequence[str], output: int) -> Figure:
    """The panels of a 3D body: each component as a surface and, beside or below, its cut."""
    points = view.results.points[view.results.body]
    clips = [clip_for(view, name) for name in names]
    camera = camera_for(points)
    box = np.array(list(itertools.product(*zip(points.min(axis=0), points.max(axis=0)))))
    seen = np.ptp(camera.flat(box), axis=0)
    sizes = [np.ptp(np.delete(box, clip.axis, axis=1), axis=0) + view.spacing for clip in clips]
    surface_shape = float(seen[1] / seen[0])
    cut_shape = max(float(size[1] / size[0]) for size in sizes)
    beside = len(names) == 1 and surface_shape > 0.5
    columns = 1 if len(names) == 1 else min(len(names), 3)
    width = 4.8 if columns == 1 else 3.6 if columns == 2 else 3.0
    below = 1 / cut_shape > 2.2
    heights = [float(np.clip(width * surface_shape, 0.8, 4.5)),
               float(np.clip((width - (0.6 if below else 1.2)) * cut_shape, 0.4, 4.0))
               + (1.1 if below else 0.75)]
    blocks = -(-len(names) // columns)
    if beside:
        figure = new_figure(7.2, float(np.clip(max(3.0 * surface_shape, 2.8 * cut_shape) + 0.7, 2.6,
                                               5.0)))
        grid = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.15))
        places = [(grid[0, 0], grid[0, 1])]
    else:
        figure = new_figure(width * columns, sum(heights) * blocks + 0.3)
        grid = figure.add_gridspec(2 * blocks, columns, height_ratios=heights * blocks)
        places = [(grid[2 * (k // columns), k % columns], grid[2 * (k // columns) + 1, k % columns])
                  for k in range(len(names))]
    for name, clip, (surface, cut) in zip(names, clips, places):
        draw_surface(figure.add_subplot(surface), view, name, output, view.clip)
        draw_cut(figure.add_subplot(cut), view, name, output, clip)
    return figure


def arrange(view: View, output: int, count: int) -> tuple[int, int, float, float]:
    """Columns and rows of plane panels, and the size of one [inches], for the shape of the body."""
    positions = view.positions(output)[view.results.body]
    if view.window is not None:
        wide, high = (float(view.window[c][1] - view.window[c][0]) for c in (0, 1))
    else:
        wide, high = (float(np.ptp(positions[:, c]) + view.spacing) for c in (0, 1))
    shape = high / wide
    if count == 1:
        columns = 1
    elif shape < 0.45:
        columns = 1 if count <= 3 else 2
    else:
        columns = {2: 2, 3: 3, 4: 2}.get(count, 3)
    width = {1: 4.8, 2: 3.6, 3: 3.0}[columns]
    below = 1 / shape > 2.2
    height = (width - (0.6 if below else 1.25)) * shape + (1.0 if below else 0.55)
    return columns, -(-count // columns), width, float(np.clip(height, 1.5, 6.5))


def new_figure(width: float, height: float) -> Figure:
    """A figure whose panels arrange themselves."""
    return Figure(figsize=(width, height), layout="constrained")
