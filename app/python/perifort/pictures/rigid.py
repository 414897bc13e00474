"""Outlines of rigid bodies: where their signed distance is zero in the plane of a picture; of closed
surfaces from files where facets cross it.
"""
from __future__ import annotations

import base64
import xml.etree.ElementTree as tree
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from ..results import Results
from ..scene import Group, Scene

Array = npt.NDArray[Any]
# Places along the longer side of a picture at which distances are computed
FINE = 400


def turned(axis: Array, angle: float) -> Array:
    """The matrix of a rotation about an axis by an angle [rad]."""
    length = float(np.linalg.norm(axis))
    if length == 0.0 or angle == 0.0:
        return np.eye(3)
    x, y, z = axis / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def vector(group: Group, key: str, otherwise: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
    """A key with up to three numbers."""
    if key not in group:
        return np.array(otherwise, dtype=float)
    given = np.atleast_1d(np.asarray(group[key], dtype=float))
    return np.concatenate([given, np.zeros(3 - len(given))])


def axes_along(direction: Array) -> Array:
    """Three axes at right angles as columns, of which the third has a direction."""
    third = direction / np.linalg.norm(direction)
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(third)))], third)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third], axis=1)


def surfaces_of(results: Results, output: int) -> tuple[Array, Array, Array]:
    """The file with the surfaces of rigid bodies at an output: places of vertices (n, 3), corners of
    triangles (m, 3), and the number of each one's body from 1.
    """
    series = results.folder / f"{results.name}_rigid.pvd"
    files = {float(entry.get("timestep", "nan")): series.parent / entry.get("file", "")
             for entry in tree.parse(series).getroot().iter("DataSet")}
    return read_triangles(files[min(files, key=lambda time: abs(time - results.times[output]))])


def read_triangles(path: Path) -> tuple[Array, Array, Array]:
    """Vertices, corners and bodies of a file of triangles that the program wrote."""
    kinds = {"Float64": np.float64, "Int64": np.int64}
    found = {}
    for array in tree.parse(path).getroot().iter("DataArray"):
        # Eight bytes say how many follow
        data = base64.b64decode((array.text or "").strip())[8:]
        found[array.get("Name")] = np.frombuffer(data, kinds[array.get("type", "")])
    return (found["Points"].reshape(-1, 3), found["connectivity"].reshape(-1, 3),
            found["rigid_body"])


class ClosedSurface:
    """A `&rigid` that is a closed surface from a file, at one output of a run."""

    def __init__(self, results: Results, group: Group, number: int, output: int,
                 scale: float = 1.0) -> None:
        """`scale` is that of the drawn displacements, `number` counts the bodies from 1."""
        places, corners, body = surfaces_of(results, output)
        history = results.history
        row = int(np.argmin(np.abs(history["time"] - results.times[output])))
        shift = np.array([history[f"{group['name']}_displacement_{c}"][row] for c in "xyz"])
        self.places = places + (scale - 1.0) * shift
        self.corners = corners[body == number]

    def cut(self, axis: int, at: float) -> list[Array]:
        """Closed lines (n, 3) in which a plane normal to an axis cuts the surface."""
        above = self.places[:, axis] >= at
        follows = {}
        sides = above[self.corners]
        for triangle in self.corners[sides.any(axis=1) & ~sides.all(axis=1)]:
            for k in range(3):
                a, b = int(triangle[k]), int(triangle[(k + 1) % 3])
                if above[b] and not above[a]:
                    enters = (a, b)
                elif above[a] and not above[b]:
                    leaves = (b, a)
            follows[enters] = leaves
        lines = []
        while follows:
            edge, chain = next(iter(follows)), []
            while edge in follows:
                chain.append(edge)
                edge = follows.pop(edge)
            low, high = self.places[np.array(chain).T]
            part = (at - low[:, axis]) / (high[:, axis] - low[:, axis])
            lines.append(low + part[:, None] * (high - low))
        return lines

    def shadow(self, flat: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Triangles (n, 3, 2) whose union is the silhouette, and the edges (m, 2, 2) around it, in
        the projection `flat`.
        """
        shown = flat(self.places)[self.corners]
        first, second = shown[:, 1] - shown[:, 0], shown[:, 2] - shown[:, 0]
        front = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] > 0.0
        edges = np.concatenate([self.corners[front][:, [k, (k + 1) % 3]] for k in range(3)])
        _, at, uses = np.unique(np.sort(edges, axis=1), axis=0, return_index=True,
                                return_counts=True)
        return shown[front], flat(self.places)[edges[at[uses == 1]]]


class RigidBody:
    """A `&rigid` of a run at one output."""

    def __init__(self, results: Results, group: Group, output: int, scale: float = 1.0) -> None:
        """`scale` is that of the drawn displacements."""
        self.shape = str(group["shape"])
        self.dimension = results.dimension
        history = results.history
        name = str(group["name"])
        row = int(np.argmin(np.abs(history["time"] - results.times[output])))

        def now(what: str) -> Array:
            return np.array([history[f"{name}_{what}_{c}"][row]
                             if f"{name}_{what}_{c}" in history else 0.0 for c in "xyz"])

        rotation = now("rotation")
        self.centre = vector(group, "centre") + scale * now("displacement")
        frame = np.eye(3)
        if self.shape == "cylinder":
            frame = axes_along(vector(group, "axis", (0.0, 0.0, 1.0)))
        elif self.shape == "half_space":
            frame = axes_along(vector(group, "normal"))
        elif self.shape == "box":
            angle = float(np.radians(np.asarray(group.get("angle", 0.0), dtype=float)))
            frame = turned(vector(group, "axis", (0.0, 0.0, 1.0)), angle)
        self.frame = turned(rotation, float(np.linalg.norm(rotation))) @ frame
        self.radius = float(np.asarray(group.get("radius", 0.0), dtype=float))
        self.length = float(np.asarray(group.get("length", 0.0), dtype=float))
        self.edges = vector(group, "edges")

    def gap(self, places: Array) -> Array:
        """Signed distances of places (.., 3) from the surface [m], negative within."""
        own = (places - self.centre) @ self.frame
        if self.shape == "sphere":
            return np.asarray(np.linalg.norm(own, axis=-1) - self.radius)
        if self.shape == "half_space":
            return np.asarray(own[..., 2])
        if self.shape == "cylinder":
            beyond = np.stack([np.hypot(own[..., 0], own[..., 1]) - self.radius,
                               np.abs(own[..., 2]) - self.length / 2], axis=-1)
        else:
            beyond = (np.abs(own) - self.edges / 2)[..., :self.dimension]
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))


    def rim(self) -> Array:
        """Places (n, 3) on the surface whose convex hull is the body; of a half-space none."""
        angle = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
        ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        if self.shape == "sphere":
            height = np.linspace(-1.0, 1.0, 33)[:, None, None]
            own = self.radius * (np.sqrt(1 - height**2) * ring + height * np.eye(3)[2])
        elif self.shape == "cylinder":
            own = self.radius * ring + np.array([[[-0.5]], [[0.5]]]) * self.length * np.eye(3)[2]
        elif self.shape == "box":
            own = 0.5 * self.edges * (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1.0)
        else:
            own = np.zeros((0, 3))
        return np.asarray(self.centre + own.reshape(-1, 3) @ self.frame.T)


def hull(places: Array) -> Array:
    """The corners (m, 2) of the convex hull of places (n, 2), in their order around it."""
    def half(ordered: Array) -> list[Array]:
        chain: list[Array] = []
        for place in ordered:
            while len(chain) > 1:
                a, b = chain[-1] - chain[-2], place - chain[-1]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                chain.pop()
            chain.append(place)
        return chain[:-1]

    ordered = places[np.lexsort((places[:, 1], places[:, 0]))]
    return np.array(half(ordered) + half(ordered[::-1]))


def rigid_bodies(results: Results, output: int,
                 scale: float = 1.0) -> list[RigidBody | ClosedSurface]:
    """All rigid bodies of a run as they are at an output."""
    if "&rigid" not in results.scene:
        return []
    groups = Scene.parse(results.scene, check=False).all("rigid")
    return [ClosedSurface(results, group, number, output, scale)
            if str(group["shape"]) == "surface" else RigidBody(results, group, output, scale)
            for number, group in enumerate(groups, 1)]


def fill_lines(axes: Axes, lines: Sequence[Array], **style: Any) -> None:
    """Fill what closed lines (n, 2) enclose, once where they lie on each other."""
    if lines:
        axes.add_patch(PathPatch(Outline.make_compound_path(
            *[Outline(np.concatenate([line, line[:1]]), closed=True) for line in lines]), **style))


def draw_silhouettes(axes: Axes, bodies: Sequence[RigidBody | ClosedSurface],
                     flat: Callable[[Array], Array]) -> None:
    """The outlines of rigid bodies in a picture of bodies in 3D: `flat` is its projection."""
    for body in bodies:
        if isinstance(body, ClosedSurface):
            triangles, edges = body.shadow(flat)
            fill_lines(axes, list(triangles), facecolor=(0.5, 0.5, 0.5, 0.25), edgecolor="none")
            axes.plot(*np.moveaxis(edges, 0, 2).swapaxes(0, 1), color="0.25", linewidth=0.8)
            continue
        rim = body.rim()
        if len(rim):
            axes.fill(*hull(flat(rim)).T, facecolor=(0.5, 0.5, 0.5, 0.25), edgecolor="0.25",
                      linewidth=0.8)


def draw_outlines(axes: Axes, bodies: Sequence[RigidBody | ClosedSurface], shown: Sequence[int],
                  plane: float = 0.0) -> None:
    """Outlines of rigid bodies within the limits of a picture whose axes are `shown`; of bodies in
    3D in the plane where the third component is `plane`.
    """
    if not bodies:
        return
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    count = np.maximum(np.ceil(FINE * (high - low) / (high - low).max()).astype(int), 8)
    x, y = np.meshgrid(*[np.linspace(low[c], high[c], count[c]) for c in (0, 1)])
    places = np.full((*x.shape, 3), plane)
    places[..., shown[0]], places[..., shown[1]] = x, y
    for body in bodies:
        if isinstance(body, ClosedSurface):
            axis = next(c for c in range(3) if c not in shown)
            fill_lines(axes, [line[:, list(shown)] for line in body.cut(axis, plane)],
                       facecolor=(0.5, 0.5, 0.5, 0.25), edgecolor="0.25", linewidth=0.8)
            continue
        gap = body.gap(places)
        if gap.min() < 0.0:
            axes.contourf(x, y, gap, [-np.inf, 0.0], colors=["0.5"], alpha=0.25)
            if gap.max() > 0.0:
                axes.contour(x, y, gap, [0.0], colors=["0.25"], linewidths=0.8)
