"""Pictures of turned lattices: their cells, faces and cuts lie along `axis_1` and `axis_2`."""
import itertools
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import perifort
from perifort.pictures import cells, elements, levels
from perifort.pictures.fields import Clip, View, camera_for, figure_of, surface_of

from .synthetic import lattice, write_results

ROWS = np.array([[2.0, 1.0, 0.5], [-1.0, 3.0, 0.7]])


def directions(first, second):
    """Three axes as rows, as `axis_1` and `axis_2` give them."""
    first = first / np.linalg.norm(first)
    second = second - (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def group(first, second=None):
    """A body of a scene."""
    text = "&body\n  axis_1 = " + ", ".join(repr(float(value)) for value in first)
    if second is not None:
        text += "\n  axis_2 = " + ", ".join(repr(float(value)) for value in second)
    return text + "\n/\n"


def area_of(polygons):
    """The areas of plane polygons (n, corners, 2)."""
    x, y = polygons[..., 0], polygons[..., 1]
    return 0.5 * np.abs(np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1))


class TestTurned(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def results(self, points, scene, body=None, moved=None):
        n = len(points)
        u = np.zeros((1, n, 3)) if moved is None else (moved - points)[None]
        path = write_results(self.folder / "made.vtkhdf", points, times=(0.0,), scene=scene, fields={
            "displacement": ("m", "x y z", u), "damage": ("1", "", np.arange(n)[None] / n)})
        results = perifort.open(path)
        results.marks["body"] = np.ones(n, dtype=int) if body is None else body
        return results

    def test_squares_lie_along_the_rows(self):
        for angle in (30.0, 45.0, 90.0):
            a = np.radians(angle)
            axes = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0, 0, 1]])
            points = lattice((7, 5), 2e-3) @ axes + [0.3, -0.2, 0.0]
            part, = cells.parts_of(self.results(points, group(axes[0, :2])))
            self.assertAlmostEqual(part.lattice.spacing, 2e-3)
            shown = levels.quads(part, points)
            np.testing.assert_allclose(area_of(shown), 4e-6, rtol=1e-9)
            around = 1e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes[:2, :2]
            np.testing.assert_allclose(shown, points[:, None, :2] + around, atol=1e-12)
            # Deformed ones too
            gradient = np.array([[1.02, 0.1], [-0.03, 0.95]])
            moved = points[:, :2] @ gradient.T
            np.testing.assert_allclose(levels.quads(part, moved), shown @ gradient.T, atol=1e-12)

    def test_many_cells_are_an_image_without_gaps(self):
        for angle in (3.0, 10.0, 17.0, 22.5, 30.0, 36.0, 40.0, 45.0, 60.0):
            a = np.radians(angle)
            axes = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0, 0, 1]])
            points = (lattice((80, 80)) - [0.04, 0.04, 0.0]) @ axes
            view = View(self.results(points, group(axes[0, :2])), deform=0.0)
            with mock.patch("perifort.pictures.fields.MOST_CELLS", 1000):
                image = figure_of(view, ["damage"], 0).axes[0].images[0]
            shown = np.ma.getmaskarray(image.get_array())
            left, right, low, high = image.get_extent()
            rows, columns = shown.shape
            x, y = np.meshgrid(left + (np.arange(columns) + 0.5) / columns * (right - left),
                               low + (np.arange(rows) + 0.5) / rows * (high - low))
            inside = np.hypot(x, y) < 0.036
            self.assertGreater(inside.sum(), 1500)
            self.assertFalse(shown[inside].any())

    def test_bodies(self):
        first = np.array([3.0, 1.0, 0.0])
        axes = directions(first, np.array([-1.0, 3.0, 0.0]))
        one, two = lattice((6, 4)) @ axes, (lattice((6, 4)) + [6e-3, 1e-3, 0.0]) @ axes
        body = np.repeat([1, 2], 24)
        both = np.concatenate([one, two])
        # On one grid, on two, one of them not turned
        same = cells.parts_of(self.results(both, group(first[:2]) + group(2 * first[:2]), body))
        self.assertEqual([len(part.points) for part in same], [48])
        shifted = np.concatenate([one, two + [0.3e-3, 0.0, 0.0]])
        parts = cells.parts_of(self.results(shifted, 2 * group(first[:2]), body))
        self.assertEqual([part.lattice.turned for part in parts], [True, True])
        mixed = np.concatenate([one, lattice((6, 4)) + [20e-3, 0.0, 0.0]])
        parts = cells.parts_of(self.results(mixed, group(first[:2]) + "&body\n/\n", body))
        self.assertEqual([part.lattice.turned for part in parts], [True, False])
        self.assertEqual([len(part.points) for part in parts], [24, 24])

    def test_outer_faces(self):
        counts = (6, 4, 3)
        axes = directions(*ROWS)
        points = lattice(counts, 1.0) @ axes
        view = View(self.results(points, group(*ROWS)))
        quad, _ = surface_of(view, "damage", 0, camera_for(points), None)
        normal = 0.5 * np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
        # Their areas, and by the divergence theorem the volume they enclose
        self.assertAlmostEqual(np.linalg.norm(normal, axis=1).sum(), 2 * (24 + 18 + 12), places=9)
        self.assertAlmostEqual((quad.mean(axis=1) * normal).sum() / 3, 72.0, places=9)
        along = np.abs(normal @ axes.T).max(axis=1)
        np.testing.assert_allclose(along, 1.0, rtol=1e-9)

    def test_cuts(self):
        size, counts = 0.5, (8, 6, 6)
        half = 0.5 * size * np.array(counts)
        for first, second, axis in itertools.product(
                ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], ROWS[0]),
                ([0.0, 1.0, 1.0], [2.0, 0.0, 1.0], ROWS[1]), range(3)):
            axes = directions(np.array(first), np.array(second))
            points = (lattice(counts, size) - half) @ axes
            one, = cells.parts_of(self.results(points, group(first, second)))
            for at in (0.0, 0.37, -0.8):
                found, which = elements.cut_of_lattice(one.lattice, points, points, axis, at)
                shown = np.delete(found, axis, axis=2)
                np.testing.assert_allclose(found[:, :, axis], at, atol=1e-9)
                expected, error = self.section(axes, half, axis, at)
                self.assertAlmostEqual(area_of(shown).sum(), expected, delta=error)
                # Each polygon lies in the cell of its own point
                apart = np.abs((found - points[which][:, None]) @ axes.T).max()
                self.assertLess(apart, 0.5 * size * (1 + 1e-6))

    def section(self, axes, half, axis, at):
        """The area of the section of a box, by lines of the plane, and the error of that: a line at
        each end of the section.
        """
        count = 40000
        others = [c for c in range(3) if c != axis]
        reach = np.linalg.norm(half)
        apart = 2 * reach / count
        across = (np.arange(count) + 0.5) * apart - reach
        start = np.zeros((count, 3))
        start[:, axis], start[:, others[0]] = at, across
        own, slope = start @ axes.T, axes[:, others[1]]
        low, high = np.full(count, -np.inf), np.full(count, np.inf)
        for c in range(3):
            if abs(slope[c]) < 1e-12:
                outside = np.abs(own[:, c]) > half[c]
                high[outside] = -np.inf
                continue
            ends = np.sort([(-half[c] - own[:, c]) / slope[c], (half[c] - own[:, c]) / slope[c]],
                           axis=0)
            low, high = np.maximum(low, ends[0]), np.minimum(high, ends[1])
        return np.maximum(high - low, 0.0).sum() * apart, 4 * apart * reach

    def test_cuts_in_faces(self):
        """A plane between two layers takes one of them, one in a face of the body the cells inside."""
        axes = directions(np.array([1.0, 1.0, 0.0]), np.array([-1.0, 1.0, 0.0]))
        points = lattice((5, 4, 6), 1.0) @ axes
        one, = cells.parts_of(self.results(points, group(axes[0], axes[1])))
        for at in (0.0, 2.0, 6.0):
            found, _ = elements.cut_of_lattice(one.lattice, points, points, 2, at)
            self.assertAlmostEqual(area_of(found[:, :, :2]).sum(), 20.0, places=6)

    def test_pictures(self):
        points = lattice((12, 8, 6)) @ directions(*ROWS)
        view = View(self.results(points, group(*ROWS), moved=points * [1.1, 1.0, 1.0]), clip=Clip(2))
        figure = figure_of(view, ["damage"], 0)
        low, high = view.positions(0).min(axis=0), view.positions(0).max(axis=0)
        limits = [axes.get_xlim() for axes in figure.axes if axes.get_title().startswith("cut")]
        self.assertEqual(len(limits), 1)
        # Corners of cells are within the frame
        self.assertLess(limits[0][0], low[0] - view.reach)
        self.assertGreater(limits[0][1], high[0] + view.reach)
        self.assertGreater(view.reach, 0.5e-3 * np.abs(directions(*ROWS)).sum(axis=0).max() * 0.99)


if __name__ == "__main__":
    unittest.main()
