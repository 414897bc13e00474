"""Refined lattices as they are drawn: each level on its own lattice, without gaps between them."""
from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from .cells import Beside, Part

Array = npt.NDArray[Any]


def quads(part: Part, positions: Array) -> Array:
    """The deformed cells (n, 4, 2) of a plane part, corner after corner. `positions` are those of
    all points.
    """
    if part.lattice is not None:
        return corners_of(part, positions[:, :2])[:, [0, 2, 3, 1]]
    corners = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(positions[part.points, None, :2] + corners * part.sizes[:, None, None])


def corners_of(part: Part, positions: Array, of: Array | None = None) -> Array:
    """The corners (n, 2^dimension, component) of the deformed cells of a part on a lattice, of all
    or of those with the numbers `of`. Those on cells of the next coarser level are where these have
    them: at their corners, or in the middle of their edges and faces. `positions` are those of all
    points.
    """
    lattice, coarser = part.lattice, part.coarser
    assert lattice is not None
    of = np.arange(len(part.points)) if of is None else of
    found = lattice.corners(positions[part.points], of, _beside(part, positions))
    if coarser is None or not len(of):
        return found
    coarse = coarser.lattice
    assert coarse is not None
    at = lattice.middles[of][:, None] + 0.5 * lattice.spacing * lattice.signs
    total, count = np.zeros(found.shape), np.zeros(found.shape[:2])
    for sign in lattice.signs:
        cells = coarse.cells_at(at + 0.1 * lattice.spacing * sign)
        there = cells >= 0
        if not there.any():
            continue
        used, row = np.unique(cells[there], return_inverse=True)
        shapes = corners_of(coarser, positions, used)[row.ravel()]
        local = (at[there] - coarse.middles[cells[there]]) / (0.5 * coarse.spacing)
        weights = np.prod(0.5 * (1.0 + local[:, None] * coarse.signs), axis=2)
        total[there] += np.einsum("ns,nsc->nc", weights, shapes)
        count[there] += 1
    on = count > 0
    joined = total[on] / count[on][:, None]
    # Across a crack they stay apart, as those of one level do
    near = np.linalg.norm(joined - found[on], axis=1) < 0.35 * coarse.spacing
    found[on] = np.where(near[:, None], joined, found[on])
    return found


def _beside(part: Part, positions: Array) -> Beside | None:
    """Of cells between finer ones: the mean of the finer cells on a side, which is 3/4 of a spacing
    away at rest.
    """
    lattice, finer = part.lattice, part.finer
    if finer is None:
        return None

    def mean(axis: int, step: int, cells: Array) -> Array:
        assert lattice is not None and finer is not None and finer.lattice is not None
        number = finer.lattice.cells_at(_ahead(part, axis, step, cells))
        apart = positions[finer.points[number]].mean(axis=1) - positions[part.points[cells]]
        apart[np.any(number < 0, axis=1)] = np.inf
        return np.asarray(apart / 0.75)

    return mean


def _ahead(part: Part, axis: int, step: int, cells: Array) -> Array:
    """Where finer cells on one side of cells have their middles at rest (n, cells, dimension)."""
    lattice = part.lattice
    assert lattice is not None
    quarters = 0.25 * lattice.spacing * lattice.signs[lattice.signs[:, axis] > 0]
    quarters[:, axis] = 0.75 * step * lattice.spacing
    return np.asarray(lattice.middles[cells][:, None] + quarters)


def open_faces(part: Part, kept: Array, points: Array,
               positions: Array) -> list[tuple[Array, list[int]]]:
    """The faces of a part in 3D on a lattice, as `Lattice.faces` has them, without those that cells
    of the next levels cover. `kept`, `points` and `positions` are those of all points.
    """
    lattice = part.lattice
    assert lattice is not None
    faces = lattice.faces(kept[part.points])
    if part.coarser is None and part.finer is None:
        return faces
    found = []
    for (axis, step), (cells, around) in zip(itertools.product(range(3), (1, -1)), faces):
        covered = np.zeros(len(cells), dtype=bool)
        at = _ahead(part, axis, step, cells)
        if part.coarser is not None:
            covered |= _joined(part, cells, part.coarser, at.mean(axis=1), kept, points, positions)
        if part.finer is not None:
            covered |= np.all([_joined(part, cells, part.finer, at[:, k], kept, points, positions)
                               for k in range(at.shape[1])], axis=0)
        found.append((cells[~covered], around))
    return found


def _joined(part: Part, cells: Array, other: Part, at: Array, kept: Array, points: Array,
            positions: Array) -> Array:
    """Whether a kept cell of another part is at each place, and has not gone from the own cell: no
    further than neighbours of one level may to hang together (`Lattice.edges`).
    """
    assert part.lattice is not None and other.lattice is not None
    number = other.lattice.cells_at(at)
    one, two = part.points[cells], other.points[number]
    moved = (positions[two] - positions[one]) - (points[two] - points[one])
    return np.asarray((number >= 0) & kept[two]
                      & (np.linalg.norm(moved, axis=1)
                         < 0.75 * (part.lattice.spacing + other.lattice.spacing)))
