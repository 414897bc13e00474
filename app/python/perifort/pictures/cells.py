"""The cells that points stand for: their corners in the deformed body, faces and cuts."""
from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ..results import Cells, Results
from ..scene import Scene
from .rigid import vector

Array = npt.NDArray[Any]
# From an axis, a step along it (1 or -1) and numbers of cells: vectors from their points to where
# next ones would be, infinite where that is not known
Beside = Callable[[int, int, Array], Array]


class Lattice:
    """Points on a grid of one spacing in 1, 2 or 3 dimensions. `place` (n, dimension): whole
    numbers, the cell of each point; `axes` (dimension, dimension): the directions of its rows, those
    of x, y and z if not given; `origin` (dimension): where place 0 is along the rows [m].
    """

    def __init__(self, place: Array, spacing: float, axes: Array | None = None,
                 origin: Array | None = None) -> None:
        self.place = place - place.min(axis=0) + 1
        self.origin = spacing * (place.min(axis=0) - 1) + (0.0 if origin is None else origin)
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

    @property
    def middles(self) -> Array:
        """The middles of the cells along the rows (n, dimension) at rest [m]."""
        return np.asarray(self.origin + self.spacing * self.place)

    def cells_at(self, where: Array) -> Array:
        """The numbers of the cells at positions along the rows (.., dimension) at rest, -1 where
        there is none.
        """
        place = np.rint((where - self.origin) / self.spacing).astype(np.int64)
        outside = np.any((place < 0) | (place >= self.extents), axis=-1)
        place[outside] = 0
        return np.asarray(self.number[np.ravel_multi_index(
            tuple(np.moveaxis(place, -1, 0)), self.extents)])

    def edges(self, positions: Array, beside: Beside | None = None) -> Array:
        """The edges of the deformed cells (n, direction, component): the distance to the next point
        on that side where the deformation is the smaller one. Across a crack this is the distance
        on the side of the body; a point that moves alone keeps its square. `beside` tells the
        distance for cells that have no neighbours of their own along an axis.
        """
        n, d = positions.shape
        found = np.empty((n, d, d))
        for axis in range(d):
            rest = self.spacing * self.axes[axis]
            best = np.tile(rest, (n, 1))
            least = np.full(n, 1.5 * self.spacing)
            others = {step: self.neighbour(axis, step) for step in (1, -1)}
            alone = np.flatnonzero((others[1] < 0) & (others[-1] < 0))
            for step, other in others.items():
                there = other >= 0
                apart = np.full((n, d), np.inf)
                apart[there] = step * (positions[other[there]] - positions[there])
                if beside is not None and len(alone):
                    apart[alone] = step * beside(axis, step, alone)
                stretch = np.linalg.norm(apart - rest, axis=1)
                nearer = stretch < least
                best[nearer], least[nearer] = apart[nearer], stretch[nearer]
            found[:, axis] = best
        return found

    def corners(self, positions: Array, of: Array | None = None,
                beside: Beside | None = None) -> Array:
        """The corners of the deformed cells (n, 2^dimension, component), in the order of `signs`,
        of all points or those with the numbers `of`. Cells that hang together share their corners,
        so that no gaps are left; across a crack they do not. `beside` as of `edges`.
        """
        of = np.arange(len(positions)) if of is None else of
        own = positions[:, None] + 0.5 * np.einsum("sa,nac->nsc", self.signs,
                                                   self.edges(positions, beside))
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


@dataclass(eq=False)
class Part:
    """Points that are drawn alike: their numbers in the results, their size, and the lattice they
    are on, None for a cloud; or, of meshes whose elements are known, with these elements. `coarser`
    and `finer` are the next levels of a refined lattice.
    """

    points: Array
    sizes: Array
    lattice: Lattice | None
    mesh: Cells | None = None
    coarser: Part | None = field(default=None, repr=False)
    finer: Part | None = field(default=None, repr=False)


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


def lattice_of(points: Array, dimension: int, axes: Array | None = None,
               spacing: float = np.nan) -> Lattice | None:
    """The lattice with rows along `axes`, or along x, y and z, that the points are on, None if they
    are on none; of the given spacing [m], or, if it is not a number, of the one they seem to have.
    """
    used = points[:, :dimension] if axes is None else points[:, :dimension] @ axes.T
    if np.isnan(spacing):
        if len(points) < 2:
            return None
        spacing = spacing_of(used, dimension)
    at = (used - used.min(axis=0)) / spacing
    place = np.round(at).astype(np.int64)
    # Positions in single precision keep 1e-4 of a spacing
    if np.abs(at - place).max() > 1e-3 or np.prod(place.max(axis=0) + 3.0) > 2e8:
        return None
    if len(np.unique(place, axis=0)) < len(place):
        return None
    return Lattice(place, spacing, axes, used.min(axis=0))


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
    """The body's points, without layers: on one lattice if they all are and have cells of one size,
    else body by body (and level by level of a refined one), each on its own, which may be turned,
    or as a cloud. Meshes whose elements are known are one part.
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
    marks = np.stack([results.marks.get(name, np.ones(len(results.points)))[inside]
                      for name in ("body", "level")], axis=1).astype(int)
    kinds, kind = np.unique(marks, axis=0, return_inverse=True)
    groups = [inside[kind.ravel() == number] for number in range(len(kinds))]
    axes = [turned.get(int(body)) for body, _ in kinds]
    # Of all bodies, if their rows have the same directions and their cells the same size
    alike = all(one is axes[0] or (one is not None and axes[0] is not None
                                   and np.allclose(one, axes[0], rtol=0, atol=1e-12))
                for one in axes)
    spacings, typical = spacings_of(results, groups, axes)
    whole = None
    if alike and not np.ptp(spacings) > 0.05 * spacings.min():
        whole = lattice_of(results.points[inside], dimension, axes[0], typical)
    if whole is not None:
        return [*found, Part(inside, np.full(len(inside), whole.spacing), whole)]
    levels: dict[tuple[int, int], Part] = {}
    for (body, level), points, rows, spacing in zip(kinds, groups, axes, spacings):
        lattice = lattice_of(results.points[points], dimension, rows, spacing)
        if lattice is None and np.isfinite(spacing):
            # Another body, all of whose cells are cut
            lattice = lattice_of(results.points[points], dimension, rows)
        if lattice is not None:
            sizes = np.full(len(points), lattice.spacing)
        else:
            volume = results.volume[points]
            apart = spacing_of(results.points[points] if len(points) > 1
                               else results.points[inside], dimension)
            sizes = apart * (volume / np.median(volume)) ** (1 / dimension)
        part = levels[int(body), int(level)] = Part(points, sizes, lattice)
        found.append(part)
        coarser = levels.get((int(body), int(level) - 1))
        if lattice is not None and coarser is not None and coarser.lattice is not None:
            part.coarser, coarser.finer = coarser, part
    return found


def spacings_of(results: Results, groups: list[Array],
                axes: list[Array | None]) -> tuple[Array, float]:
    """The spacing of each group of points if these are on lattices, and that of the largest group,
    which follows from the distances of its points. The others are that times the root of the ratio
    of the volumes: few cells that are left between finer ones may have no neighbours that would
    tell it. The volume is that of the largest cell, since those at a surface may be cut. Not a
    number if the largest group is no lattice.
    """
    dimension = results.dimension
    largest = int(np.argmax([len(points) for points in groups]))
    lattice = lattice_of(results.points[groups[largest]], dimension, axes[largest])
    own = np.nan if lattice is None else lattice.spacing
    volumes = np.array([results.volume[points].max() for points in groups])
    return own * (volumes / volumes[largest]) ** (1 / dimension), own


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
