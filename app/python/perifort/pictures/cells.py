"""The cells that points stand for: their corners in the deformed body, faces and cuts."""
from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..results import Cells, Results
from ..scene import Scene
from .rigid import vector

Array = npt.NDArray[Any]


class Lattice:
    """Points on a grid of one spacing in 1, 2 or 3 dimensions. `place` (n, dimension): whole
    numbers, the cell of each point; `axes` (dimension, dimension): the directions of its rows, those
    of x, y and z if not given.
    """

    def __init__(self, place: Array, spacing: float, axes: Array | None = None) -> None:
        self.place = place - place.min(axis=0) + 1
        self.spacing = spacing
        self.dimension = place.shape[1]
        self.turned = axes is not None
        self.axes: Array = np.eye(self.dimension) if axes is None else axes
        # A rim of one empty cell, so that every cell has neighbours to look at
        self.extents = tuple(int(n) for n in self.place.max(axis=0) + 2)
        self.number = np.full(int(np.prod(self.extents)), -1, dtype=np.int64)
        self.number[self._line(self.place)] = np.arange(len(place))
        self.signs = np.array(list(itertools.product((-1, 1), repeat=self.dimension)))

    def _line(self, place: Array) -> Array:
        """Places as numbers in a row."""
        return np.asarray(np.ravel_multi_index(tuple(place.T), self.extents))

    def neighbour(self, axis: int, step: int) -> Array:
        """The number of the point one cell on along an axis, -1 where there is none."""
        place = self.place.copy()
        place[:, axis] += step
        return np.asarray(self.number[self._line(place)])

    def edges(self, positions: Array) -> Array:
        """The edges of the deformed cells (n, direction, component): the distance to the next point
        on that side where the deformation is the smaller one. Across a crack this is the distance
        on the side of the body; a point that moves alone keeps its square.
        """
        n, d = positions.shape
        found = np.empty((n, d, d))
        for axis in range(d):
            rest = self.spacing * self.axes[axis]
            best = np.tile(rest, (n, 1))
            least = np.full(n, 1.5 * self.spacing)
            for step in (1, -1):
                other = self.neighbour(axis, step)
                there = other >= 0
                apart = np.full((n, d), np.inf)
                apart[there] = step * (positions[other[there]] - positions[there])
                stretch = np.linalg.norm(apart - rest, axis=1)
                nearer = stretch < least
                best[nearer], least[nearer] = apart[nearer], stretch[nearer]
            found[:, axis] = best
        return found

    def corners(self, positions: Array, of: Array | None = None) -> Array:
        """The corners of the deformed cells (n, 2^dimension, component), in the order of `signs`,
        of all points or those with the numbers `of`. Cells that hang together share their corners,
        so that no gaps are left; across a crack they do not.
        """
        of = np.arange(len(positions)) if of is None else of
        own = positions[:, None] + 0.5 * np.einsum("sa,nac->nsc", self.signs, self.edges(positions))
        # The cells at each corner: at most one in each of the directions
        base = self.place[of][:, None] + (self.signs + 1) // 2
        found = np.zeros((len(of), *own.shape[1:]))
        for slot in range(len(self.signs)):
            total = np.zeros((len(of), own.shape[2]))
            count = np.zeros(len(of))
            for seen in range(len(self.signs)):
                # The cell that has this corner in its own direction `seen`
                place = base[:, slot] - (self.signs[seen] + 1) // 2
                other = self.number[self._line(place)]
                there = other >= 0
                other = np.where(there, other, 0)
                near = there & (np.linalg.norm(own[other, seen] - own[of, slot], axis=1)
                                < 0.35 * self.spacing)
                total[near] += own[other[near], seen]
                count[near] += 1
            found[:, slot] = total / np.maximum(count, 1)[:, None]
        return found

    @property
    def reach(self) -> Array:
        """How far a cell at rest extends from its point along x, y and z (dimension)."""
        return np.asarray(0.5 * self.spacing * np.abs(self.axes).sum(axis=0))

    def corners_at_rest(self, points: Array) -> Array:
        """The corners (n, 2^dimension, component) of the cells of points, in the order of `signs`.
        """
        return np.asarray(points[:, None] + 0.5 * self.spacing * self.signs @ self.axes)

    def faces(self, kept: Array) -> list[tuple[Array, list[int]]]:
        """The faces of 3D cells behind which there is none: for each of the six directions the
        numbers of the cells among the `kept` ones, and the four corners seen from outside.
        """
        found = []
        slots = {tuple(sign): slot for slot, sign in enumerate(self.signs)}
        for axis, step in itertools.product(range(3), (1, -1)):
            other = self.neighbour(axis, step)
            open_face = kept & ((other < 0) | ~kept[np.where(other >= 0, other, 0)])
            p, q = (axis + 1) % 3, (axis + 2) % 3
            around = []
            for along, across in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                sign = [0, 0, 0]
                sign[axis], sign[p], sign[q] = step, along, across
                around.append(slots[tuple(sign)])
            found.append((np.flatnonzero(open_face), around[::step]))
        return found


@dataclass
class Part:
    """Points that are drawn alike: their numbers in the results, their size, and the lattice they
    are on, None for a cloud; or, of meshes whose elements are known, with these elements.
    """

    points: Array
    sizes: Array
    lattice: Lattice | None
    mesh: Cells | None = None


def spacing_of(points: Array, dimension: int) -> float:
    """A typical distance between neighbours: exact on a lattice that fills its box."""
    best = np.inf
    for axis in range(dimension):
        extent = np.ptp(points[:, axis])
        steps = np.diff(np.unique(np.round(points[:, axis], 12)))
        steps = steps[steps > 1e-6 * extent]
        if len(steps):
            best = min(best, float(np.median(steps)))
    extents = np.ptp(points, axis=0)[:dimension]
    if not np.isfinite(best):
        return float(max(extents.max(), 1e-12))
    mean = float((np.prod(np.maximum(extents, best)) / len(points)) ** (1 / dimension))
    # In a cloud coordinates hardly repeat, and the steps between them say nothing
    return best if best > 0.2 * mean else mean


def lattice_of(points: Array, dimension: int, axes: Array | None = None) -> Lattice | None:
    """The lattice with rows along `axes`, or along x, y and z, that the points are on, None if they
    are on none.
    """
    used = points[:, :dimension] if axes is None else points[:, :dimension] @ axes.T
    spacing = spacing_of(used, dimension)
    at = (used - used.min(axis=0)) / spacing
    place = np.round(at).astype(np.int64)
    # Positions in single precision keep 1e-4 of a spacing
    if np.abs(at - place).max() > 1e-3 or np.prod(place.max(axis=0) + 3.0) > 2e8:
        return None
    if len(np.unique(place, axis=0)) < len(place):
        return None
    return Lattice(place, spacing, axes)


def axes_of(results: Results) -> dict[int, Array]:
    """The directions (dimension, dimension) of the rows of turned lattices, by the numbers of their
    bodies: `axis_1`, in 3D the part of `axis_2` that is normal to it, and what is normal to these.
    """
    found: dict[int, Array] = {}
    if "axis_1" not in results.scene:
        return found
    for number, group in enumerate(Scene.parse(results.scene, check=False).all("body"), 1):
        if "axis_1" not in group:
            continue
        first = vector(group, "axis_1")
        first /= np.linalg.norm(first)
        second = vector(group, "axis_2", (-first[1], first[0], 0.0))
        second -= (second @ first) * first
        second /= np.linalg.norm(second)
        axes = np.stack([first, second, np.cross(first, second)])
        found[number] = axes[:results.dimension, :results.dimension]
    return found



def parts_of(results: Results) -> list[Part]:
    """The body's points, without layers: on one lattice if they all are, else body by body (and
    level by level of a refined one), each on its own, which may be turned, or as a cloud. Meshes
    whose elements are known are one part.
    """
    dimension = results.dimension
    inside = np.flatnonzero(results.body)
    found = []
    if results.cells is not None and dimension > 1:
        points = np.flatnonzero(results.cells.of_mesh)
        sizes = spacing_of(results.points[points], dimension) * (
            results.volume[points] / np.median(results.volume[points])) ** (1 / dimension)
        found.append(Part(points, sizes, None, results.cells))
        inside = inside[~results.cells.of_mesh[inside]]
        if not len(inside):
            return found
    turned = axes_of(results)
    bodies = results.marks.get("body", np.ones(len(results.points), dtype=int))
    # Of all bodies, if their rows have the same directions
    axes = [turned.get(int(body)) for body in np.unique(bodies[inside])]
    alike = all(one is axes[0] or (one is not None and axes[0] is not None
                                   and np.allclose(one, axes[0], rtol=0, atol=1e-12))
                for one in axes)
    whole = (lattice_of(results.points[inside], dimension, axes[0])
             if len(inside) > 1 and alike else None)
    if whole is not None:
        return [*found, Part(inside, np.full(len(inside), whole.spacing), whole)]
    marks = np.stack([results.marks.get(name, np.zeros(len(results.points)))[inside]
                      for name in ("body", "level")], axis=1)
    kinds, kind = np.unique(marks, axis=0, return_inverse=True)
    for number in range(len(kinds)):
        points = inside[kind.ravel() == number]
        lattice = (lattice_of(results.points[points], dimension, turned.get(int(kinds[number][0])))
                   if len(points) > 1 else None)
        if lattice is not None:
            sizes = np.full(len(points), lattice.spacing)
        else:
            volume = results.volume[points]
            typical = spacing_of(results.points[points] if len(points) > 1
                                 else results.points[inside], dimension)
            sizes = typical * (volume / np.median(volume)) ** (1 / dimension)
        found.append(Part(points, sizes, lattice))
    return found


def quads(part: Part, positions: Array) -> Array:
    """The deformed cells (n, 4, 2) of a plane part, corner after corner."""
    if part.lattice is not None:
        return part.lattice.corners(positions[:, :2])[:, [0, 2, 3, 1]]
    corners = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(positions[:, None, :2] + corners * part.sizes[:, None, None])


def best_cut(results: Results, values: Array, points: Array) -> int:
    """The axis to which the cut of a 3D body is normal: of the cuts that show how the values vary,
    since they hardly vary across them, the largest one.
    """
    extents = np.ptp(points, axis=0)
    finite = np.isfinite(values)
    spread = float(np.var(values[finite])) if finite.any() else 0.0
    across, areas = [], []
    for axis in range(3):
        others = [c for c in range(3) if c != axis]
        areas.append(float(np.prod(extents[others])))
        # Lines along the axis: points whose other coordinates fall into the same of some 24 bins
        bins = np.floor((points[:, others] - points[:, others].min(axis=0))
                        / (extents[others] / 24 + 1e-300)).astype(int)
        _, line = np.unique(bins, axis=0, return_inverse=True)
        line = line.ravel()
        count = np.bincount(line[finite])
        mean = np.bincount(line[finite], values[finite]) / np.maximum(count, 1)
        within = float(np.mean((values[finite] - mean[line[finite]]) ** 2)) if spread else 0.0
        across.append(within / spread if spread else 0.0)
    good = [axis for axis in range(3) if across[axis] <= min(across) + 0.5]
    # Of equals the one that is seen from the front: normal to y
    return max(good, key=lambda axis: (round(areas[axis] / max(areas), 6), axis == 1))
