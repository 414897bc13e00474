"""Elements of a mesh as they are drawn: polygons in the plane, outer faces and cuts of solids."""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..results import Cells
from .cells import Lattice

Array = npt.NDArray[Any]
Faces = Sequence[Sequence[int]]

# VTK's kinds of cells, with its order of nodes. Around a plane cell:
AROUND = {5: [0, 1, 2], 22: [0, 3, 1, 4, 2, 5], 9: [0, 1, 2, 3], 23: [0, 4, 1, 5, 2, 6, 3, 7],
          28: [0, 4, 1, 5, 2, 6, 3, 7]}
# The faces of solid cells by their corners, seen from outside
FACES: dict[int, Faces] = {
    10: [(0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)],
    12: [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)],
    13: [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    14: [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]}
# The edges with a node in the middle, which follows the corners in this order
EDGES: dict[int, Faces] = {
    10: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    12: [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6),
         (3, 7)],
    13: [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]}
# Quadratic kinds: the linear kind and the number of corners
LINEAR = {24: (10, 4), 25: (12, 8), 29: (12, 8), 26: (13, 6)}
# Tetrahedra that fill a cell, by its corners
TETRAHEDRA: dict[int, Faces] = {
    10: [(0, 1, 2, 3)],
    12: [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)],
    13: [(0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)], 14: [(0, 1, 2, 4), (0, 2, 3, 4)]}


def polygons(cells: Cells, positions: Array) -> tuple[Array, Array]:
    """Plane cells as polygons (n, 8, components), whose last corner is repeated, and their
    numbers. `positions` are those of the nodes.
    """
    found, which = [], []
    for kind, around in AROUND.items():
        at = np.flatnonzero(cells.types == kind)
        if len(at):
            nodes = cells.nodes_of(at)[:, [*around, *[around[-1]] * (8 - len(around))]]
            found.append(positions[nodes])
            which.append(at)
    return np.concatenate(found), np.concatenate(which)


def outer_faces(cells: Cells, positions: Array, kept: Array) -> tuple[Array, Array]:
    """The faces (n, 4, 3) of the `kept` solid cells behind which there is no other one, those of
    quadratic cells in several flat ones, and the numbers of their cells. A triangle has its last
    corner twice.
    """
    keys, owners, pieces = [], [], []
    for kind in np.unique(cells.types):
        linear, corners = LINEAR.get(int(kind), (int(kind), 0))
        if linear not in FACES:
            continue
        at = np.flatnonzero((cells.types == kind) & kept)
        if not len(at):
            continue
        nodes = cells.nodes_of(at)
        for face in FACES[linear]:
            key = np.sort(nodes[:, face], axis=1)
            if len(face) == 3:
                key = np.column_stack([np.full(len(at), -1), key])
            keys.append(key)
            owners.append(at)
            pieces.append(_flat_pieces(positions[nodes], face,
                                       EDGES[linear] if corners else (), corners))
    key = np.concatenate(keys)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    outer = np.zeros(len(key), dtype=bool)
    outer[first[count == 1]] = True
    found, which, begin = [], [], 0
    for owner, piece in zip(owners, pieces):
        here = outer[begin:begin + len(owner)]
        begin += len(owner)
        found.append(piece[here].reshape(-1, 4, 3))
        which.append(np.repeat(owner[here], piece.shape[1]))
    return np.concatenate(found), np.concatenate(which)


def _flat_pieces(nodes: Array, face: Sequence[int], edges: Faces, corners: int) -> Array:
    """A face of each cell as flat pieces (n, pieces, 4, 3): one, or four around its middle nodes."""
    n = len(face)
    around = nodes[:, list(face)]
    if not edges:
        return around[:, [*range(n), *[n - 1] * (4 - n)]][:, None]
    sides = [tuple(sorted((face[i], face[(i + 1) % n]))) for i in range(n)]
    numbers = {tuple(sorted(edge)): corners + i for i, edge in enumerate(edges)}
    middle = nodes[:, [numbers[side] for side in sides]]
    if n == 3:
        parts = [(around[:, i], middle[:, i], middle[:, i - 1], middle[:, i - 1]) for i in range(3)]
        parts.append((middle[:, 0], middle[:, 1], middle[:, 2], middle[:, 2]))
    else:
        # The middle of a face with eight nodes, which is within a hair of a node there
        centre = 0.5 * middle.sum(axis=1) - 0.25 * around.sum(axis=1)
        parts = [(around[:, i], middle[:, i], centre, middle[:, i - 1]) for i in range(4)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1)


def cut_of(cells: Cells, rest: Array, moved: Array, axis: int, at: float) -> tuple[Array, Array]:
    """Where the plane at `at` along an axis cuts solid cells: polygons (n, 4, 3) in the deformed
    body, and the numbers of their cells. Cells count by their corners.
    """
    found, which = [np.empty((0, 4, 3))], [np.empty(0, dtype=int)]
    for kind in np.unique(cells.types):
        linear, _ = LINEAR.get(int(kind), (int(kind), 0))
        if linear in TETRAHEDRA:
            every = np.flatnonzero(cells.types == kind)
            shown, of = cut_of_kind(linear, cells.nodes_of(every), rest[:, axis] - at, moved)
            found.append(shown)
            which.append(every[of])
    return np.concatenate(found), np.concatenate(which)


def cut_of_kind(kind: int, nodes: Array, heights: Array, moved: Array) -> tuple[Array, Array]:
    """Where a plane cuts cells of one linear kind: polygons (n, 4, 3) and the rows of `nodes` (cells,
    nodes of one) that they belong to. `heights` are those of all nodes above the plane at rest.
    """
    found, which = [np.empty((0, 4, 3))], [np.empty(0, dtype=int)]
    for four in TETRAHEDRA[kind]:
        corner = nodes[:, four]
        # A plane through nodes lies a hair below them
        height = heights[corner]
        above = height >= 0
        for side in (True, False):
            alone = np.flatnonzero((above == side).sum(axis=1) == 1)
            if len(alone):
                one = np.argmax(above[alone] == side, axis=1)
                others = np.array([[c for c in range(4) if c != k] for k in range(4)])[one]
                shown = [_between(corner[alone], height[alone], moved, one, others[:, k])
                         for k in (0, 1, 2, 2)]
                found.append(np.stack(shown, axis=1))
                which.append(alone)
        two = np.flatnonzero(above.sum(axis=1) == 2)
        if len(two):
            order = np.argsort(~above[two], axis=1, kind="stable").T
            shown = [_between(corner[two], height[two], moved, order[a], order[b])
                     for a, b in ((0, 2), (0, 3), (1, 3), (1, 2))]
            found.append(np.stack(shown, axis=1))
            which.append(two)
    return np.concatenate(found), np.concatenate(which)


def cut_of_lattice(lattice: Lattice, points: Array, positions: Array, axis: int,
                   at: float) -> tuple[Array, Array]:
    """Where the plane at `at` along an axis cuts the cells of a turned lattice: polygons (n, 4, 3) in
    the deformed body, and the numbers of their points. `points` and `positions` (all points of the
    lattice, 3): at rest and deformed.
    """
    hair = 1e-3 * lattice.spacing
    # Of planes in the faces of the body, the cells inside
    reach = lattice.reach[axis]
    low, high = points[:, axis].min() - reach, points[:, axis].max() + reach
    if low - hair <= at <= high + hair:
        at = float(np.clip(at, low + hair, high - hair))
    near = np.flatnonzero(np.abs(points[:, axis] - at) <= reach + hair)
    heights = lattice.corners_at_rest(points[near])[:, :, axis].ravel() - at
    # The same corners of two cells are on the same side
    heights[np.abs(heights) < 1e-6 * lattice.spacing] = 0.0
    moved = lattice.corners(positions, near).reshape(-1, 3)
    # Corners in VTK's order
    order = [0, 4, 6, 2, 1, 5, 7, 3]
    nodes = np.arange(8 * len(near)).reshape(-1, 8)[:, order]
    found, which = cut_of_kind(12, nodes, heights, moved)
    return found, near[which]


def _between(corner: Array, height: Array, moved: Array, a: Array, b: Array) -> Array:
    """The point of the plane on the edge between two corners of each tetrahedron."""
    row = np.arange(len(corner))
    share = height[row, a] / (height[row, a] - height[row, b])
    return np.asarray(moved[corner[row, a]] * (1 - share)[:, None]
                      + moved[corner[row, b]] * share[:, None])
