"""Pictures of lattices with several spacings: every point is a cell of its own spacing."""
import itertools
import tempfile
import unittest
from pathlib import Path

import numpy as np
import perifort
from matplotlib.collections import PolyCollection
from matplotlib.path import Path as Outline
from perifort.pictures import cells, levels
from perifort.pictures.fields import (Clip, View, camera_for, draw_cut, figure_of, position_of,
                                      surface_of)

from .synthetic import lattice, write_results
from .test_turned import area_of, directions


def refined(counts, low, high, most=2, spacing=1.0):
    """A box of cells that are halved once where their centres are between `low` and `high` [cells],
    and again, up to `most` levels, half a cell further inside: points, their sizes and levels.
    """
    dimension = len(counts)
    points, sizes, level = lattice(counts, 1.0), np.ones(np.prod(counts)), np.zeros(np.prod(counts))
    for n in range(most):
        inner = np.asarray(low) + 1.0 * n, np.asarray(high) - 1.0 * n
        halved = (level == n) & np.all((points[:, :dimension] > inner[0])
                                       & (points[:, :dimension] < inner[1]), axis=1)
        new = []
        for sign in itertools.product((-1, 1), repeat=dimension):
            shift = np.zeros(3)
            shift[:dimension] = sign
            new.append(points[halved] + 0.25 * sizes[halved][:, None] * shift)
        own = np.concatenate([sizes[~halved], *[0.5 * sizes[halved]] * 2**dimension])
        level = np.concatenate([level[~halved], np.full(len(own) - (~halved).sum(), n + 1)])
        points, sizes = np.concatenate([points[~halved], *new]), own
    order = np.argsort(level, kind="stable")
    return spacing * points[order], spacing * sizes[order], level[order].astype(int)


def bent(points):
    """A smooth map of the plane or of space without symmetry."""
    x, y, z = points.T
    return np.stack([x + 0.02 * y**2 + 0.01 * z * x, y - 0.015 * x**2 + 0.05 * z,
                     z + 0.01 * x * y], axis=1)


class TestLevels(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def results(self, points, sizes, level=None, *, body=None, moved=None, scene=None):
        n = len(points)
        u = np.zeros((1, n, 3)) if moved is None else (moved - points)[None]
        text = {} if scene is None else {"scene": scene}
        path = write_results(self.folder / "made.vtkhdf", points, times=(0.0,), fields={
            "displacement": ("m", "x y z", u), "damage": ("1", "", np.arange(n)[None] / n)}, **text)
        results = perifort.open(path)
        results.marks["body"] = np.ones(n, dtype=int) if body is None else body
        if level is not None:
            results.marks["level"] = level
        results.volume = 1e-3 * sizes**results.dimension if results.dimension == 2 else sizes**3
        return results

    def shown(self, parts, positions, count):
        """The cells in the order of the points."""
        found = np.full((count, 4, 2), np.nan)
        for part in parts:
            found[part.points] = levels.quads(part, positions)
        return found

    def test_squares_have_their_own_size(self):
        for spacing, axes in ((1.0, np.eye(3)), (2.3e-4, np.eye(3)),
                              (1e-3, directions(np.array([3.0, 1.0, 0.0]), np.array([0, 1.0, 0])))):
            points, sizes, level = refined((14, 9), (3, 2), (12, 8), spacing=spacing)
            points = points @ axes + [0.3 * spacing, -7.1 * spacing, 0.0]
            scene = f"&body\n  axis_1 = {float(axes[0, 0])!r}, {float(axes[0, 1])!r}\n/\n"
            results = self.results(points, sizes, level, scene=scene)
            parts = cells.parts_of(results)
            self.assertEqual([part.lattice is None for part in parts], [False] * 3)
            around = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes[:2, :2]
            np.testing.assert_allclose(
                self.shown(parts, points, len(points)),
                points[:, None, :2] + sizes[:, None, None] * around, atol=1e-9 * spacing)

    def test_deformed_cells_have_no_gaps(self):
        points, sizes, level = refined((14, 9), (3, 2), (12, 8))
        moved = bent(points)
        parts = cells.parts_of(self.results(points, sizes, level))
        shown = self.shown(parts, moved, len(points))
        # Places inside lie in one cell, a few on edges aside, that of a point near their own
        at = np.random.default_rng(3).random((1500, 3)) * [13.6, 8.6, 0.0] + [0.2, 0.2, 0.0]
        at = bent(at)[:, :2]
        inside = np.array([Outline(cell).contains_points(at) for cell in shown])
        np.testing.assert_array_equal(inside.sum(axis=0), 1)
        owner = np.argmax(inside, axis=0)
        apart = np.linalg.norm(moved[owner, :2] - at, axis=1)
        self.assertLess((apart / sizes[owner]).max(), 1.2)

    def test_a_crack_between_levels_stays_open(self):
        points, sizes, level = refined((8, 6), (0, 3), (8, 6), most=1)
        upper = points[:, 1] > 3.0
        np.testing.assert_array_equal(upper, level == 1)
        for wide, least in ((2.0, 5.0), (0.05, 3.05)):
            moved = points + np.where(upper, wide, 0.0)[:, None] * [0.0, 1.0, 0.0]
            parts = cells.parts_of(self.results(points, sizes, level))
            shown = self.shown(parts, moved, len(points))
            self.assertAlmostEqual(shown[~upper][..., 1].max(), 3.0)
            # A gap that is far below a cell is closed
            self.assertAlmostEqual(shown[upper][..., 1].min(), least if wide > 1 else 3.0)

    def test_bodies_of_several_spacings(self):
        """The centres of all are on one grid of a quarter; the third body has cells without
        neighbours.
        """
        one, two = lattice((6, 4), 1.0), lattice((8, 8), 0.5) + [6.0, 0.0, 0.0]
        three = 2.0 * np.array([[0.5, 5.5, 0.0], [3.5, 2.5, 0.0], [5.5, 5.5, 0.0]])
        points = np.concatenate([one, two, three])
        counts = [24, 64, 3]
        sizes, body = np.repeat([1.0, 0.5, 2.0], counts), np.repeat([1, 2, 3], counts)
        parts = cells.parts_of(self.results(points, sizes, body=body))
        for part in parts:
            np.testing.assert_allclose(part.sizes, sizes[part.points], rtol=1e-12)
        np.testing.assert_allclose(area_of(self.shown(parts, points, len(points))), sizes**2)
        # Bodies of one grid are drawn together, cut cells at their border or not
        sizes = np.repeat([1.0, 0.99, 1.0], [24, 63, 1])
        points = np.concatenate([one, lattice((9, 7), 1.0) + [6.0, 0.0, 0.0], [[3.5, 9.5, 0.0]]])
        body = np.repeat([1, 2, 3], [24, 63, 1])
        part, = cells.parts_of(self.results(points, sizes, body=body))
        self.assertEqual(part.lattice.spacing, 1.0)

    def test_outer_faces(self):
        counts = (7, 6, 5)
        # The finer cells reach two sides
        points, sizes, level = refined(counts, (2, -1, 2), (6, 5, 6), most=2)
        gradient = np.array([[1.1, 0.1, 0], [0, 0.9, 0.2], [0.1, 0, 1]])
        for moved, volume in ((points, 210.0), (bent(points), None),
                              (points @ gradient, 210.0 * np.linalg.det(gradient))):
            view = View(self.results(points, sizes, level, moved=moved), deform=1.0)
            quad, _ = surface_of(view, "damage", 0, camera_for(points), None)
            normal = 0.5 * np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
            # The sum over a closed surface is zero
            self.assertLess(np.abs(normal.sum(axis=0)).max(), 1e-9)
            if volume is not None:
                self.assertAlmostEqual((quad.mean(axis=1) * normal).sum() / 3, volume, places=8)
            # No faces inside
            if moved is points:
                self.assertAlmostEqual(np.linalg.norm(normal, axis=1).sum(),
                                       2 * (7 * 6 + 6 * 5 + 5 * 7), places=9)

    def test_cuts(self):
        points, sizes, level = refined((7, 6, 5), (2, -1, 2), (6, 5, 6), most=2)
        for moved, exact in ((points, True), (bent(points), False)):
            view = View(self.results(points, sizes, level, moved=moved), deform=1.0)
            for axis, at in itertools.product(range(3), (None, 2.5, 4.1, 4.0)):
                clip = Clip(axis, at)
                axes = figure_of(view, ["damage"], 0).axes[0]
                axes.clear()
                draw_cut(axes, view, "damage", 0, clip, bar=False)
                drawn = [path.vertices[:4] for one in axes.collections
                         if isinstance(one, PolyCollection) for path in one.get_paths()]
                area = area_of(np.array(drawn)).sum() / 1.02**2
                expected = np.prod(np.delete([7.0, 6.0, 5.0], axis))
                self.assertAlmostEqual(area, expected, delta=1e-6 if exact else 0.1 * expected)
        # The middle is that of the box
        self.assertEqual([position_of(view, Clip(axis)) for axis in range(3)], [3.5, 3.0, 2.5])

    def test_runs(self):
        """A plate and a block as the program refines them, with layers at two sides."""
        for dimension in (2, 3):
            scene = perifort.Scene("refined")
            depth = {"thickness": 1e-3} if dimension == 2 else {}
            scene.add("scene", dimension=dimension, **depth)
            scene.add("body", name="plate", lower=[0.0] * dimension,
                      upper=[0.024, 0.012, 0.008][:dimension], points=[24, 12, 8][:dimension])
            scene.add("refine", shape="box", lower=[0.009, 0.004, 0.0][:dimension],
                      upper=[0.014, 0.008, 0.004][:dimension], levels=2)
            scene.add("material", youngs_modulus=1e9, poissons_ratio=0.25, density=1000.0)
            scene.add("boundary", side="x_min", displacement_x=0.0)
            scene.add("boundary", side="x_max", displacement_x=1e-5)
            scene.add("time", steps=1, step=1e-9)
            scene.add("output", fields=["displacement", "damage"])
            results = perifort.run(scene, self.folder / f"{dimension}D", progress=False, threads=1)
            self.assertGreater(int((results.layer > 0).sum()), 0)
            parts = cells.parts_of(results)
            self.assertGreaterEqual(len(parts), 2)
            for part in parts:
                np.testing.assert_allclose(part.sizes**dimension * depth.get("thickness", 1.0),
                                           results.volume[part.points], rtol=1e-9)
            self.assertEqual(sum(len(part.points) for part in parts), int(results.body.sum()))
            path, = results.plot(field="displacement", component="x", quiet=True)
            self.assertGreater(path.stat().st_size, 5000)


if __name__ == "__main__":
    unittest.main()
