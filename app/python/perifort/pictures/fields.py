"""Panels of fields: a curve in 1D, deformed cells in 2D, a lit surface and a cut in 3D."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
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
from .cells import Lattice, Part, best_cut, parts_of
from .colours import Colours, colours_of, judged, limits_of, nice_scale, sampled
from .elements import cut_of, cut_of_lattice, outer_faces, polygons
from .layout import FONT, Panel, Place, lay_out, write_caption
from .levels import corners_of, open_faces, quads
from .rigid import draw_outlines, draw_silhouettes, rigid_bodies
from .units import Scale, number, scale_of, state_text, words

Array = npt.NDArray[Any]
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
            raise ValueError(f"'{text}' is no cut: expected x, y or z, or y=0.01 with a position "
                             "[m]")
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
    # The same frame at all outputs, as films want it
    steady: bool = False
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
    def reach(self) -> float:
        """How far cells extend at most from their points, along x, y or z."""
        return max(0.5 * self.spacing, *(float(part.lattice.reach.max()) for part in self.parts
                                         if part.lattice is not None), 0.0)

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

    def nodes(self, output: int) -> Array:
        """Positions (n, 3) of the nodes of elements as they are drawn."""
        cells = self.results.cells
        assert cells is not None
        if not self.scale:
            return cells.nodes
        moved = self.results.field("displacement", output, of="nodes")
        return np.asarray(cells.nodes + self.scale * np.asarray(moved))

    def colours(self, name: str) -> Colours:
        """The colours of a field or component, over all outputs."""
        if name not in self._colours:
            self._colours[name] = shared_colours([self], name)
        return self._colours[name]

    def seen(self, output: int) -> Array:
        """Positions of the body, without what has flown far from it, that a picture must hold: at
        this output or, of steady pictures, at all.
        """
        rest = self.results.points[self.results.body]
        room = 0.6 * float(np.ptp(rest, axis=0).max())
        low, high = rest.min(axis=0) - room, rest.max(axis=0) + room
        outputs = sampled(self.results) if self.steady else [output]
        every = np.concatenate([self.positions(k)[self.results.body] for k in outputs])
        return np.asarray(np.clip(every, low, high))

    def take_colours(self, name: str, colours: Colours) -> None:
        """Give a field other colours than those of its values."""
        self._colours[name] = colours

    def fix_colours(self, name: str, low: float, high: float) -> None:
        """Give the colours of a field other limits."""
        self._colours[name] = replace(self.colours(name), low=low, high=high, extend="neither",
                                      note="")

    def range(self, name: str) -> tuple[float, float]:
        """The smallest and largest value over all outputs, for curves."""
        parts = [values_of(self.results, name, k)[self.results.body] for k in sampled(self.results)]
        return limits_of(parts, robust=False)[2:]

    def share_colours(self, others: Sequence[View], names: Sequence[str]) -> None:
        """Give all views the same colours, those over the outputs of all."""
        for name in names:
            shared = shared_colours((self, *others), name)
            for view in (self, *others):
                view._colours[name] = shared

    def caption(self, output: int) -> str:
        """What the picture shows: `slow, t = 9.44 us, displacements x 20`."""
        r = self.results
        text = f"{r.name}, {state_text(r, output)}"
        if r.dimension > 1 and self.scale == 1.0:
            text += ", displacements to scale"
        elif r.dimension > 1 and self.scale:
            text += f", displacements \u00d7 {self.scale:.6g}"
        return text


def shared_colours(views: Sequence[View], name: str) -> Colours:
    """The colours of a field or component over all outputs of several runs."""
    base = views[0].results.split(base_name(name))[0]
    parts: list[Array] = []
    left: list[Array] = []
    for results in (view.results for view in views):
        for k in sampled(results):
            points = judged(results, base, k)
            values = values_of(results, name, k)
            parts.append(values[points])
            left.append(values[results.body & ~points])
    # Values at broken points are said to be left out where they are beyond the others
    low, high = limits_of(parts, robust=False)[2:]
    broken = any(bool(np.any((values < low) | (values > high))) for values in left)
    return colours_of(base, parts, broken)


def base_name(name: str) -> str:
    """A field without the word for its magnitude."""
    return name[:-len("_magnitude")] if name.endswith("_magnitude") else name


def values_of(results: Results, name: str, output: int = -1, of: str = "points") -> Array:
    """Values (n) of a field, of a component of it ('displacement_x', 'stress_xy'), or the magnitude
    of a vector or tensor ('displacement_magnitude'), of points or of cells.
    """
    base = base_name(name)
    values = np.asarray(results.field(base, output, of=of), dtype=float)
    if base == "fragment":
        # Numbers of colours, the same for a fragment at all outputs; none for crumbs
        _, which, sizes = np.unique(values, return_inverse=True, return_counts=True)
        return np.where(sizes[which] > 3, (values - 1) % 20, np.nan)
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
    """What is drawn of a field: a scalar, the components that are not zero, or the one asked for.
    """
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
            raise KeyError(f"'{base}' has no component '{component}'{nearest(component, parts)}; "
                           f"it has {', '.join(parts)}, and magnitude")
        return [f"{base}_{component}"]
    largest = np.zeros(len(parts))
    for k in sampled(results):
        values = np.asarray(results.field(base, k))[results.body]
        with np.errstate(invalid="ignore"):
            finite = np.where(np.isfinite(values), values, 0.0)
            largest = np.fmax(largest, np.abs(finite).max(axis=0))
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

def draw_panel(axes: Axes, view: View, name: str, output: int, *, bar: bool | Axes | None = True,
               title: str = "") -> None:
    """One field or component at one output, of a body in 1D or 2D, with its colour bar."""
    results = view.results
    values = values_of(results, name, output)
    if results.dimension == 1:
        _draw_line(axes, view, name, values)
    else:
        colours = view.colours(name)
        scale = scale_of(unit_of(results, name), [colours.low, colours.high])
        positions = view.positions(output)
        for part in view.parts:
            if part.mesh is not None:
                corners, cells = polygons(part.mesh, view.nodes(output)[:, :2])
                _draw_polygons(axes, corners, values_of(results, name, output, "cells")[cells],
                               colours, scale.factor)
        _draw_cells(axes, [(part, values[part.points]) for part in view.parts if part.mesh is None],
                    positions, colours, scale.factor)
        _label(axes, "xy", frame_of(view, output))
        draw_outlines(axes, rigid_bodies(results, output, view.scale), (0, 1))
        if bar:
            add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)), bar)
    if title:
        axes.set_title(title, fontsize=FONT)


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
        twice = 2.0 * scale.factor * high
        axes.set_ylim(min(0.0, twice), max(0.0, twice) or 1.0)
    axes.set_xlabel(along.label("x"), fontsize=FONT)
    axes.set_ylabel(scale.label(label_of(results, name)), fontsize=FONT)
    axes.grid(alpha=0.3)
    tidy(axes)


def _draw_cells(axes: Axes, parts: Sequence[tuple[Part, Array]], positions: Array,
                colours: Colours, factor: float) -> None:
    """Cells as polygons without edges that overlap by a hair, so that no lines stay between them;
    many cells as an image. `positions` are those of all points.
    """
    norm = Normalize(factor * colours.low, factor * colours.high)
    cmap = _map(colours)
    for part, values in parts:
        if len(values) > MOST_CELLS:
            _draw_image(axes, part, positions[part.points], factor * values, norm, cmap,
                        colours.map == "magma_r")
            continue
        _draw_polygons(axes, quads(part, positions), values, colours, factor)


def _draw_polygons(axes: Axes, corners: Array, values: Array, colours: Colours,
                   factor: float) -> None:
    """Polygons (n, corners, 2) in the colours of their values, a hair larger than they are."""
    middle = corners.mean(axis=1, keepdims=True)
    # Two in a hundred: less than is seen, more than rounding to pixels leaves open
    axes.add_collection(PolyCollection(
        middle + 1.02 * (corners - middle), array=factor * values, cmap=_map(colours),
        norm=Normalize(factor * colours.low, factor * colours.high), linewidths=0,
        antialiaseds=False, rasterized=True))


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
    # A stretched body, or a turned one, leaves pixels between its cells empty
    for axis in (0, 1):
        before, after = np.roll(image, 1, axis), np.roll(image, -1, axis)
        gap = np.isnan(image) & ~np.isnan(before) & ~np.isnan(after)
        image[gap] = 0.5 * (before[gap] + after[gap])
    axes.imshow(np.ma.masked_invalid(image), origin="lower", norm=norm,
                cmap=cmap.with_extremes(bad=(0.0, 0.0, 0.0, 0.0)),
                extent=(low[0], low[0] + counts[0] * pixel, low[1], low[1] + counts[1] * pixel),
                interpolation="nearest")


def frame_of(view: View, output: int, axes: Sequence[int] = (0, 1),
             within: Array | None = None) -> list[tuple[float, float]]:
    """Limits of two axes around the body, or points of it, with a small margin; or the window."""
    if view.window is not None:
        return [(float(view.window[c][0]), float(view.window[c][1])) for c in (0, 1)]
    seen = view.seen(output) if within is None else within
    limits = [(float(seen[:, c].min()) - view.reach, float(seen[:, c].max()) + view.reach)
              for c in axes]
    margin = 0.015 * max(high - low for low, high in limits)
    return [(low - margin, high + margin) for low, high in limits]


def shape_of(limits: Sequence[tuple[float, float]]) -> float:
    """Height over width."""
    return (limits[1][1] - limits[1][0]) / (limits[0][1] - limits[0][0])


def _label(axes: Axes, names: str, limits: Sequence[tuple[float, float]]) -> Scale:
    """Limits, ticks and names of equal axes in a length that reads well, which is returned. Ticks
    are round in that unit, and fewer on short sides, where their numbers would overlap.
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
    return mpl.colormaps[colours.map].with_extremes(bad="0.8")


def add_bar(axes: Axes, colours: Colours, factor: float, label: str,
            where: bool | Axes = True) -> None:
    """A colour bar in axes of its own, or beside the panel. It says if the colours do not cover all
    values.
    """
    norm = Normalize(factor * colours.low, factor * colours.high)
    shown = ScalarMappable(norm=norm, cmap=_map(colours))
    wide = False
    if isinstance(where, Axes):
        box = where.get_position()
        size = where.figure.bbox
        wide = box.width * size.width > box.height * size.height
        bar = axes.figure.colorbar(shown, cax=where, extend=colours.extend, extendfrac=0.03,
                                   orientation="horizontal" if wide else "vertical")
    else:
        bar = axes.figure.colorbar(shown, ax=axes, extend=colours.extend, extendfrac=0.03,
                                   fraction=0.046, pad=0.03)
    bar.set_label(label + (f"\n{colours.note}" if colours.note else ""), fontsize=FONT)
    bar.ax.tick_params(labelsize=FONT - 1)
    bar.locator = MaxNLocator(4 if wide else 5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    if colours.map == "tab20":
        bar.set_ticks([])
    bar.outline.set_linewidth(0.5)


# Three dimensions

class Camera:
    """A parallel view from an angle: right, up and towards the eye."""

    def __init__(self, azimuth: float = -55.0, elevation: float = 25.0) -> None:
        a, e = np.radians([azimuth, elevation])
        self.eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self.right = np.array([-np.sin(a), np.cos(a), 0.0])
        self.up = np.cross(self.eye, self.right)
        light = 0.7 * self.eye + 0.6 * self.up - 0.4 * self.right
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
    """The outer faces (n, 4, 3) of the deformed body and their values; what lies in front of the
    cut is left out. Points of clouds are small squares that face the eye.
    """
    results = view.results
    values = values_of(results, name, output)
    positions = view.positions(output)
    kept = np.ones(len(results.points), dtype=bool)
    if clip is not None:
        before = results.points[:, clip.axis] - position_of(view, clip)
        kept = before * np.sign(camera.eye[clip.axis]) <= 0.01 * view.spacing
    found, shades = [], []
    for part in view.parts:
        if part.mesh is not None:
            own = np.ones(len(part.mesh), dtype=bool)
            if clip is not None:
                middles = np.add.reduceat(
                    part.mesh.nodes[part.mesh.connectivity, clip.axis],
                    part.mesh.offsets[:-1]) / np.diff(part.mesh.offsets)
                own = (middles - position_of(view, clip)) * np.sign(camera.eye[clip.axis]) <= 0
            faces_found, owners = outer_faces(part.mesh, view.nodes(output), own)
            found.append(faces_found)
            shades.append(values_of(results, name, output, "cells")[owners])
            continue
        if part.lattice is None:
            own = kept[part.points]
            half = 0.5 * part.sizes[own, None, None] * np.array(
                [-camera.right - camera.up, camera.right - camera.up, camera.right + camera.up,
                 camera.up - camera.right])
            found.append(positions[part.points[own]][:, None] + half)
            shades.append(values[part.points[own]])
            continue
        faces = open_faces(part, kept, results.points, positions)
        used = np.unique(np.concatenate([cells for cells, _ in faces]))
        row = np.full(len(part.points), -1)
        row[used] = np.arange(len(used))
        corners = corners_of(part, positions, used)
        for cells, around in faces:
            found.append(corners[row[cells]][:, around])
            shades.append(values[part.points[cells]])
    return np.concatenate(found), np.concatenate(shades)


def position_of(view: View, clip: Clip) -> float:
    """Where the plane of a cut is: as given, or in the middle of the body."""
    along = view.results.points[view.results.body, clip.axis]
    if clip.at is None:
        # Of the cells, which may be larger on one side than on the other
        ends = [view.results.points[part.points, clip.axis] + side * (
            0.5 * part.sizes if part.lattice is None else part.lattice.reach[clip.axis])
            for part in view.parts for side in (-1, 1)]
        return 0.5 * float(min(e.min() for e in ends) + max(e.max() for e in ends))
    if not along.min() - view.reach <= clip.at <= along.max() + view.reach:
        raise ValueError(f"the cut at {'xyz'[clip.axis]} = {clip.at:g} m misses the body, which "
                         f"lies between {along.min():.6g} and {along.max():.6g} m")
    return clip.at


def surface_frame(view: View, output: int, camera: Camera) -> list[tuple[float, float]]:
    """Limits of the picture of a surface: the whole body, also where it is cut."""
    flat = camera.flat(view.seen(output))
    room = 0.9 * view.spacing + 0.02 * float(np.ptp(flat, axis=0).max())
    return [(float(flat[:, c].min()) - room, float(flat[:, c].max()) + room) for c in (0, 1)]


def draw_surface(axes: Axes, view: View, name: str, output: int, clip: Clip | None = None,
                 bar: bool | Axes | None = False) -> None:
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
        rgba[:, :3] *= (0.68 + 0.32 * np.clip(normal @ camera.light, 0.0, 1.0))[:, None]
        order = np.argsort(depth)
        # Edges in the colour of the face close the hairlines between faces
        axes.add_collection(PolyCollection(flat[order], facecolors=rgba[order],
                                           edgecolors=rgba[order], linewidths=0.3, rasterized=True))
    draw_silhouettes(axes, rigid_bodies(results, output, view.scale), camera.flat)
    limits = surface_frame(view, output, camera)
    axes.set(xlim=limits[0], ylim=limits[1], aspect="equal")
    axes.set_axis_off()
    _triad(axes, camera)
    if bar:
        scale = scale_of(unit_of(results, name), [colours.low, colours.high])
        add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)), bar)


def _triad(axes: Axes, camera: Camera) -> None:
    """The directions x, y, z in the lower left corner, of one size in all pictures."""
    for axis, name in enumerate("xyz"):
        x, y = 17.0 * camera.flat(np.eye(3)[axis])
        axes.annotate(name, (0.03, 0.03), (float(x), float(y)), xycoords="axes fraction",
                      textcoords="offset points", fontsize=FONT - 1, ha="center", va="center",
                      annotation_clip=False,
                      arrowprops={"arrowstyle": "<-", "linewidth": 0.7, "shrinkA": 1, "shrinkB": 0})


def draw_cut(axes: Axes, view: View, name: str, output: int, clip: Clip,
             bar: bool | Axes | None = True) -> None:
    """The layer of cells that a plane cuts, seen along its normal, with equal axes."""
    results = view.results
    values = values_of(results, name, output)
    positions = view.positions(output)
    plane = position_of(view, clip)
    # x to the right where it lies in the plane, z upwards
    shown = [c for c in range(3) if c != clip.axis]
    parts = []
    cuts: dict[int, Part] = {}
    colours = view.colours(name)
    scale = scale_of(unit_of(results, name), [colours.low, colours.high])
    for part in view.parts:
        if part.mesh is not None:
            corners, cells = cut_of(part.mesh, part.mesh.nodes, view.nodes(output), clip.axis, plane)
            _draw_polygons(axes, corners[:, :, shown],
                           values_of(results, name, output, "cells")[cells], colours, scale.factor)
            continue
        if part.lattice is not None and part.lattice.turned:
            corners, cells = cut_of_lattice(part.lattice, results.points[part.points],
                                            positions[part.points], clip.axis, plane)
            _draw_polygons(axes, corners[:, :, shown], values[part.points[cells]], colours,
                           scale.factor)
            continue
        apart = np.abs(results.points[part.points, clip.axis] - plane)
        near = np.flatnonzero(apart <= part.sizes / 2 * (1 + 1e-6))
        if not len(near):
            continue
        if part.lattice is not None:
            # A plane between two layers takes one of them
            layer = part.lattice.place[near, clip.axis]
            near = near[layer == layer.min()]
            flat = Lattice(part.lattice.place[near][:, shown], part.lattice.spacing,
                           origin=part.lattice.origin[shown])
        else:
            flat = None
        cut = Part(part.points[near], part.sizes[near], flat)
        # Levels stand in their order
        cut.coarser = cuts.get(id(part.coarser))
        if cut.coarser is not None:
            cut.coarser.finer = cut
        cuts[id(part)] = cut
        parts.append((cut, values[cut.points]))
    _draw_cells(axes, parts, positions[:, shown], colours, scale.factor)
    limits = cut_frame(view, output, clip)
    unit = _label(axes, "".join("xyz"[c] for c in shown), limits)
    draw_outlines(axes, rigid_bodies(results, output, view.scale), shown, plane)
    plane = 0.0 if abs(plane) < 1e-6 * view.spacing else plane
    axes.set_title(f"cut at {'xyz'[clip.axis]} = {number(plane * unit.factor)} {unit.text}",
                   fontsize=FONT)
    if bar:
        add_bar(axes, colours, scale.factor, scale.label(label_of(results, name)), bar)


def cut_frame(view: View, output: int, clip: Clip) -> list[tuple[float, float]]:
    """Limits of the picture of a cut: the whole body along its axes."""
    seen = view.seen(output)
    shown = [c for c in range(3) if c != clip.axis]
    return frame_of(replace(view, window=None), output, shown, seen)


def clip_for(view: View, name: str) -> Clip:
    """The cut that was asked for, or the plane through the middle that shows how the field varies.
    """
    if view.clip is not None:
        return view.clip
    results = view.results
    last = values_of(results, name, -1)[results.body]
    return Clip(best_cut(results, last, results.points[results.body]))


# Pictures

def figure_of(view: View, names: Sequence[str], output: int, caption: str | None = None) -> Figure:
    """One picture of one field: a panel for each of the names, its components, at one output."""
    if view.results.dimension == 3:
        figure = _solid_figure(view, names, output)
    elif view.results.dimension == 2:
        figure = _plane_figure(view, names, output)
    else:
        figure, rows = lay_out([[Panel(0.45, bar="")] for _ in names], 5.0)
        for name, row in zip(names, rows):
            draw_panel(_there(row[0]).axes, view, name, output)
    write_caption(figure, view.caption(output) if caption is None else caption)
    return figure


def _there(place: Place | None) -> Place:
    """A place that a panel has been laid out for."""
    assert place is not None
    return place


def _plane_figure(view: View, names: Sequence[str], output: int) -> Figure:
    """Panels of a plane body, side by side or, of long bodies, one over the other."""
    shape = shape_of(frame_of(view, output))
    count = len(names)
    columns = min(count, 1 if shape < 0.45 and count <= 3 else 2 if count in (2, 4) else 3)
    width = {1: 4.8, 2: 3.6, 3: 3.1}[columns]
    panels: list[Panel | None] = [panel_for(view, name, shape) for name in names]
    rows = [panels[k:k + columns] for k in range(0, count, columns)]
    figure, places = lay_out(rows, width)
    for name, place in zip(names, [_there(place) for row in places for place in row]):
        draw_panel(place.axes, view, name, output, bar=place.bar)
    return figure


def panel_for(view: View, name: str, shape: float, title: bool = False, axes: bool = True) -> Panel:
    """The panel of a field: its colour bar stands below flat bodies, where it is longer."""
    note = view.colours(name).note
    return Panel(shape, "below" if shape < 0.4 else "beside",
                 1 + (note.count("\n") + 1 if note else 0), title, axes)


def _solid_figure(view: View, names: Sequence[str], output: int) -> Figure:
    """The panels of a 3D body: each component as a surface and, beside or below, its cut."""
    camera = camera_for(view.results.points[view.results.body])
    surface = Panel(shape_of(surface_frame(view, output, camera)), bar="", axes=False)
    clips = [clip_for(view, name) for name in names]
    cuts = [panel_for(view, name, shape_of(cut_frame(view, output, clip)), title=True)
            for name, clip in zip(names, clips)]
    columns = 1 if len(names) == 1 else 2 if len(names) in (2, 4) else 3
    rows: list[list[Panel | None]] = []
    beside = len(names) == 1 and surface.shape > 0.5
    if beside:
        rows = [[surface, cuts[0]]]
        at = [(0, 0)]
    else:
        at = []
        for k in range(0, len(names), columns):
            block = cuts[k:k + columns]
            at += [(len(rows), c) for c in range(len(block))]
            rows += [[surface] * len(block), list(block)]
    figure, places = lay_out(rows, 3.6 if beside else {1: 4.8, 2: 3.6, 3: 3.1}[columns],
                             most=4.5 if beside else 3.5)
    for name, clip, (row, column) in zip(names, clips, at):
        upper = _there(places[row][column])
        lower = _there(places[row][1] if beside else places[row + 1][column])
        draw_surface(upper.axes, view, name, output, view.clip)
        draw_cut(lower.axes, view, name, output, clip, lower.bar)
    return figure


def figure_of_panels(items: Sequence[tuple[View, str, int, str]], columns: int, width: float,
                     caption: str = "") -> Figure:
    """Panels of several runs, fields or outputs, each with its title, row by row: views, names of
    fields, outputs, titles. 3D bodies are drawn as surfaces.
    """
    panels: list[Panel | None] = []
    for view, name, output, _ in items:
        solid = view.results.dimension == 3
        limits = (surface_frame(view, output, camera_for(view.results.points[view.results.body]))
                  if solid else frame_of(view, output))
        panels.append(panel_for(view, name, shape_of(limits), True, not solid))
    rows = [panels[k:k + columns] for k in range(0, len(panels), columns)]
    figure, places = lay_out(rows, width, bool(caption))
    flat = [_there(place) for row in places for place in row]
    for (view, name, output, title), place in zip(items, flat):
        if view.results.dimension == 3:
            draw_surface(place.axes, view, name, output, view.clip, place.bar)
            place.axes.set_title(title, fontsize=FONT)
        else:
            draw_panel(place.axes, view, name, output, bar=place.bar, title=title)
    if caption:
        write_caption(figure, caption)
    return figure
