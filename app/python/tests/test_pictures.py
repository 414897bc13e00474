"""Pictures: units, limits, cells, and what the written files show."""
import base64
import contextlib
import io
import itertools
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import perifort
from matplotlib.image import imread
from perifort import pictures
from perifort.pictures import cells, colours, units
from perifort.pictures.fields import Clip, View, figure_of, names_of, values_of, worth_drawing
from perifort.pictures.layout import Panel, lay_out
from perifort.pictures.rigid import ClosedSurface, RigidBody, hull, read_triangles

from .synthetic import lattice, run_history, write_results


class TestUnits(unittest.TestCase):
    def test_prefix(self):
        for unit, value, text, shown in (
                ("Pa", 3.2e6, "MPa", 3.2), ("Pa", 0.5, "Pa", 0.5), ("m", 0.001, "mm", 1.0),
                ("m", 0.05, "mm", 50.0), ("m", 2.0, "m", 2.0), ("m", 5e-6, "\u00b5m", 5.0),
                ("s", 1.7e-5, "\u00b5s", 17.0), ("N", -4.2e4, "kN", -42.0), ("J", 0.02, "mJ", 20.0),
                ("m/s", 1500.0, "m/s", 1500.0), ("N/m3", 1e6, "MN/m$^{3}$", 1.0),
                ("J/m3", 2.5e4, "kJ/m$^{3}$", 25.0), ("kg", 1e-3, "kg", 1e-3),
                ("Pa m1/2", 2e6, "MPa m$^{1/2}$", 2.0), ("m2", 1e-4, "m$^{2}$", 1e-4),
                ("1", 0.5, "", 0.5), ("1", 2e-3, "10$^{-3}$", 2.0), ("1", 3e6, "10$^{6}$", 3.0),
                ("m", 0.0, "m", 0.0), ("K", 300.0, "K", 300.0), ("J/m2", 50.0, "J/m$^{2}$", 50.0)):
            with self.subTest(unit=unit, value=value):
                scale = units.scale_of(unit, [0.0, value])
                self.assertEqual(scale.text, text)
                self.assertAlmostEqual(value * scale.factor, shown, places=9)

    def test_values_that_are_missing(self):
        self.assertEqual(units.scale_of("Pa", [np.nan, 2e6, np.inf]).text, "MPa")
        self.assertEqual(units.scale_of("m", []).text, "m")


class TestRigidBodies(unittest.TestCase):
    def body(self, group, **history):
        columns = {"time": np.array([0.0, 1.0])}
        columns.update({f"r_{name}": np.array([0.0, value]) for name, value in history.items()})
        results = mock.Mock(dimension=3, history=columns, times=[0.0, 1.0])
        scene = perifort.Scene.parse(f"&rigid name = 'r' {group} /", check=False)
        return RigidBody(results, scene.all("rigid")[0], 1, 2.0)

    def test_distances(self):
        ball = self.body("shape = 'sphere' centre = 1, 0, 0 radius = 2", displacement_x=0.5)
        # Displacements are drawn twice as large
        np.testing.assert_allclose(ball.gap(np.array([[2.0, 0.0, 0.0], [2.0, 3.0, 4.0]])),
                                   [-2.0, 3.0])
        wall = self.body("shape = 'half_space' centre = 0, 0, 1 normal = 0, 3, 4")
        np.testing.assert_allclose(wall.gap(np.array([0.0, 3.0, 5.0])), 5.0)
        box = self.body("shape = 'box' centre = 0, 0, 0 edges = 2, 4, 6 angle = 90")
        np.testing.assert_allclose(box.gap(np.array([[5.0, 0.0, 0.0], [0.0, 5.0, 0.0],
                                                     [5.0, 5.0, 3.0], [1.9, 0.0, 0.0]])),
                                   [3.0, 4.0, 5.0, -0.1])
        rod = self.body("shape = 'cylinder' centre = 0, 0, 0 axis = 1, 0, 0 radius = 1 length = 4",
                        rotation_z=np.pi / 2)
        np.testing.assert_allclose(rod.gap(np.array([[0.0, 3.0, 0.0], [4.0, 0.0, 3.0],
                                                     [1.5, 0.0, 0.0]])), [1.0, 4.0, 0.5])
        for body in (ball, box, rod):
            np.testing.assert_allclose(body.gap(body.rim()), 0.0, atol=1e-14)

    def closed(self):
        """A box of 2 x 4 x 6 about (1, 0, 0), which has moved by 0.5 along x."""
        places = np.array([[x, y, z] for z in (-3.0, 3.0) for y in (-2.0, 2.0) for x in (-1.0, 1.0)])
        corners = np.array([[1, 4, 2], [1, 3, 4], [5, 6, 8], [5, 8, 7], [1, 2, 6], [1, 6, 5],
                            [3, 8, 4], [3, 7, 8], [1, 5, 7], [1, 7, 3], [2, 4, 8], [2, 8, 6]]) - 1
        history = {"time": np.array([0.0, 1.0]), "r_displacement_x": np.array([0.0, 0.5]),
                   "r_displacement_y": np.zeros(2), "r_displacement_z": np.zeros(2)}
        results = mock.Mock(history=history, times=[0.0, 1.0])
        found = (places + [1.5, 0.0, 0.0], np.concatenate([corners, corners[:1]]),
                 np.array([2] * 12 + [1]))
        with mock.patch("perifort.pictures.rigid.surfaces_of", return_value=found):
            return ClosedSurface(results, {"name": "r"}, 2, 1, 3.0)

    def test_closed_surfaces(self):
        box = self.closed()
        # Displacements are drawn three times as large: the middle is at 1 + 3 * 0.5
        lines = box.cut(2, 0.5)
        self.assertEqual(len(lines), 1)
        np.testing.assert_allclose(lines[0].min(axis=0), [1.5, -2.0, 0.5])
        np.testing.assert_allclose(lines[0].max(axis=0), [3.5, 2.0, 0.5])
        x, y = lines[0][:, 0], lines[0][:, 1]
        area = abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2
        self.assertAlmostEqual(area, 8.0)
        self.assertEqual(box.cut(2, 4.0), [])
        triangles, edges = box.shadow(lambda places: places[:, :2])
        sides = triangles[:, 1:] - triangles[:, :1]
        self.assertAlmostEqual(float(np.sum(np.linalg.det(sides))) / 2, 8.0)
        self.assertAlmostEqual(float(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum()), 12.0)

    def test_triangles_of_a_file(self):
        def array(name, kind, values):
            data = np.array(values).tobytes()
            text = base64.b64encode(np.uint64(len(data)).tobytes() + data).decode()
            return f'<DataArray type="{kind}" Name="{name}" format="binary">{text}</DataArray>'
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.vtp"
            path.write_text("<VTKFile>" + array("Points", "Float64", np.arange(9.0))
                            + array("connectivity", "Int64", [2, 0, 1])
                            + array("rigid_body", "Int64", [4]) + "</VTKFile>", encoding="utf-8")
            places, corners, body = read_triangles(path)
        np.testing.assert_array_equal(places, np.arange(9.0).reshape(3, 3))
        np.testing.assert_array_equal(corners, [[2, 0, 1]])
        np.testing.assert_array_equal(body, [4])

    def test_hull(self):
        inside = np.array([[0.1, 0.2], [-0.3, 0.1], [0.0, 1.0], [0.5, 0.0]])
        square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        np.testing.assert_allclose(hull(np.concatenate([inside, square])), square)


class TestColours(unittest.TestCase):
    def test_few_points_far_away(self):
        values = np.linspace(0, 1, 1000)
        values[0], values[-1] = -50.0, 300.0
        low, high, least, most = colours.limits_of([values], robust=True)
        self.assertAlmostEqual(low, 0.005, places=2)
        self.assertAlmostEqual(high, 0.995, places=2)
        self.assertEqual((least, most), (-50.0, 300.0))
        found = colours.colours_of("stress", [values])
        self.assertEqual(found.extend, "both")
        self.assertIn("0.5 to 99.5 %", found.note)

    def test_all_of_it_where_nothing_is_far(self):
        found = colours.colours_of("stress", [np.linspace(0, 1, 1000)])
        self.assertEqual((found.low, found.high, found.extend, found.note),
                         (0.0, 1.0, "neither", ""))

    def test_damage_keeps_its_peak(self):
        values = np.zeros(1000)
        values[0] = 0.3
        self.assertEqual(colours.colours_of("damage", [values]).high, 0.3)

    def test_both_signs(self):
        found = colours.colours_of("velocity", [np.linspace(-2, 1, 50)])
        self.assertEqual((found.map, found.low, found.high), ("RdBu_r", -2.0, 2.0))
        found = colours.colours_of("velocity", [np.linspace(-0.1, 1, 50)])
        self.assertEqual((found.map, found.low), ("viridis", -0.1))
        found = colours.colours_of("velocity", [np.linspace(-2, -1.9, 50)])
        self.assertEqual((found.low, found.high), (-2.0, -1.9))

    def test_limits_are_those_of_all_outputs(self):
        parts = [np.linspace(0, high, 50) for high in (1.0, 5.0, 2.0)]
        self.assertEqual(colours.colours_of("velocity", parts).high, 5.0)

    def test_the_same_everywhere(self):
        found = colours.colours_of("strain", [np.full(9, 1e-3) * (1 + 1e-12 * np.arange(9))])
        self.assertLess(found.low, 0.95e-3)
        self.assertGreater(found.high, 1.05e-3)

    def test_nothing_but_missing_values(self):
        found = colours.colours_of("stress", [np.full(9, np.nan)])
        self.assertLess(found.low, found.high)

    def test_scale_of_displacements(self):
        self.assertEqual(colours.nice_scale(1e-5, 0.1), 500.0)
        self.assertEqual(colours.nice_scale(1.4e-5, 0.1), 200.0)
        self.assertEqual(colours.nice_scale(0.004, 0.1), 1.0)
        self.assertEqual(colours.nice_scale(0.0, 0.1), 0.0)
        for displacement in 10.0 ** np.linspace(-9, -3, 61):
            self.assertLessEqual(colours.nice_scale(displacement, 0.1) * displacement, 0.00501)


class TestCells(unittest.TestCase):
    def part(self, points, dimension):
        found = cells.lattice_of(points, dimension)
        self.assertIsNotNone(found)
        return found

    def test_lattice(self):
        points = lattice((7, 5), 1e-3)
        # A hole, and any order
        keep = np.random.default_rng(1).permutation(np.flatnonzero(
            np.linalg.norm(points[:, :2] - [3.5e-3, 2.5e-3], axis=1) > 1.2e-3))
        found = self.part(points[keep], 2)
        self.assertAlmostEqual(found.spacing, 1e-3)
        back = found.place[:, :2] * found.spacing
        self.assertLess(np.ptp(back - points[keep][:, :2], axis=0).max(), 1e-9)
        self.assertIsNone(cells.lattice_of(np.random.default_rng(1).random((200, 3)), 3))
        self.assertIsNone(cells.lattice_of(np.concatenate([points, points]), 2))

    def test_cells_fill_the_body_at_rest(self):
        points = lattice((7, 5), 2.0)
        corners = self.part(points, 2).corners(points[:, :2])
        signs = np.array(list(itertools.product((-1, 1), repeat=2)))
        self.assertLess(np.abs(corners - (points[:, None, :2] + signs)).max(), 1e-12)

    def test_uniform_deformation(self):
        for dimension, counts in ((2, (6, 4)), (3, (4, 3, 5))):
            points = lattice(counts, 1.0)[:, :dimension]
            gradient = np.eye(dimension) + 0.2 * np.arange(dimension**2).reshape(
                dimension, dimension) / dimension**2
            found = self.part(np.pad(points, ((0, 0), (0, 3 - dimension))), dimension)
            signs = np.array(list(itertools.product((-1, 1), repeat=dimension)))
            expected = (points[:, None] + 0.5 * signs) @ gradient.T
            self.assertLess(np.abs(found.corners(points @ gradient.T) - expected).max(), 1e-12)

    def test_cells_that_hang_together_share_corners(self):
        points = lattice((20, 10), 1.0)
        moved = points[:, :2] + 0.1 * np.sin(points[:, [1, 0]] / 3)
        found = self.part(points, 2)
        corners = found.corners(moved)
        right = found.neighbour(0, 1)
        there = right >= 0
        # The right corners of a cell are the left ones of the next: no gap
        self.assertLess(np.abs(corners[there][:, [2, 3]] - corners[right[there]][:, [0, 1]]).max(),
                        1e-12)

    def test_a_crack_stays_open(self):
        points = lattice((10, 10), 1.0)
        upper = points[:, 1] > 5.0
        moved = points[:, :2] + np.where(upper, 3.0, 0.0)[:, None] * [0.0, 1.0]
        corners = self.part(points, 2).corners(moved)
        self.assertAlmostEqual(corners[upper][..., 1].min(), 8.0)
        self.assertAlmostEqual(corners[~upper][..., 1].max(), 5.0)

    def test_a_splinter_keeps_its_square(self):
        points = lattice((5, 5), 1.0)
        moved = points[:, :2].copy()
        moved[12] += 40.0
        corners = self.part(points, 2).corners(moved)
        self.assertLess(np.abs(np.ptp(corners[12], axis=0) - 1.0).max(), 1e-12)
        self.assertLess(corners[np.arange(25) != 12].max(), 5.0 + 1e-12)

    def test_faces(self):
        counts = (4, 3, 2)
        points = lattice(counts, 1.0)
        found = self.part(points, 3)
        kept = np.ones(len(points), dtype=bool)
        corners = found.corners(points)
        number = 0
        for numbers, around in found.faces(kept):
            quad = corners[numbers][:, around]
            normal = np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
            # Outwards: away from the middle of their cell
            outwards = (normal * (quad.mean(axis=1) - points[numbers])).sum(axis=1)
            self.assertTrue((outwards > 0).all())
            self.assertLess(np.abs(np.linalg.norm(normal, axis=1) - 2.0).max(), 1e-12)
            number += len(numbers)
        self.assertEqual(number, 2 * (4 * 3 + 3 * 2 + 4 * 2))
        inside = points[:, 0] < 2.0
        self.assertEqual(sum(len(numbers) for numbers, _ in found.faces(inside)),
                         2 * (2 * 3 + 3 * 2 + 2 * 2))

    def test_parts(self):
        # Two bodies on grids of their own, and a layer that is left out
        first, second = lattice((6, 4), 1.0), lattice((9, 7), 0.7) + [10.0, 0.33, 0.0]
        points = np.concatenate([first, second, first[:6] - [0.0, 1.0, 0.0]])
        layer = np.repeat([0, 0, 1], [24, 63, 6])
        with tempfile.TemporaryDirectory() as folder:
            path = write_results(Path(folder) / "two.vtkhdf", points, layer=layer)
            results = perifort.open(path)
        results.marks["body"] = np.repeat([1, 2, 1], [24, 63, 6])
        parts = cells.parts_of(results)
        self.assertEqual([len(part.points) for part in parts], [24, 63])
        self.assertAlmostEqual(parts[1].lattice.spacing, 0.7)

    def test_best_cut(self):
        points = lattice((30, 12, 10), 1.0)
        with tempfile.TemporaryDirectory() as folder:
            results = perifort.open(write_results(Path(folder) / "a.vtkhdf", points))
        # Values that do not vary along z, those that do not vary along x
        self.assertEqual(cells.best_cut(results, np.sin(points[:, 0]) * points[:, 1], points), 2)
        self.assertEqual(cells.best_cut(results, np.sin(points[:, 2])
                                        * (points[:, 1] - 6.0), points), 0)


def fields_of(points, outputs=3):
    """Displacement, damage and stress of a body that is stretched along x and cracks."""
    n = len(points)
    u = np.zeros((outputs, n, 3))
    stress = np.zeros((outputs, n, 6))
    damage = np.zeros((outputs, n))
    x = points - points.mean(axis=0)
    for k in range(outputs):
        u[k] = 1e-3 * k * x * [1.0, -0.3, -0.3]
        stress[k, :, 0] = 1e8 * k * (1 + x[:, 1] / max(np.ptp(x[:, 1]), 1e-3))
        damage[k, np.abs(x[:, 0]) < 2e-3] = 0.4 * k / (outputs - 1)
    return {"displacement": ("m", "x y z", u), "velocity": ("m/s", "x y z", 0 * u),
            "damage": ("1", "", damage), "stress": ("Pa", "xx yy zz xy yz xz", stress)}


class TestFiles(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def results(self, counts, static=False, name="made", **options):
        points = lattice(counts)
        fields = fields_of(points)
        if len(counts) == 1:
            fields = {"displacement": fields["displacement"]}
        options.setdefault("fields", fields)
        path = write_results(self.folder / name / f"{name}.vtkhdf", points,
                             history=run_history(static=static),
                             times=(0.0, 0.5, 1.0) if static else (0.0, 1e-5, 2e-5), **options)
        return perifort.open(path)

    def check(self, paths, expected):
        """Files of these names that open and are not blank."""
        self.assertEqual([path.name for path in paths], expected)
        for path in paths:
            image = imread(path)[..., :3]
            with self.subTest(path=path.name):
                self.assertGreater(image.shape[0], 150)
                self.assertGreater(image.shape[1], 300)
                dark = (image.min(axis=2) < 0.6).mean()
                self.assertGreater(dark, 0.003)
                self.assertLess(dark, 0.98)

    def test_plane(self):
        results = self.results((30, 20))
        with contextlib.redirect_stdout(io.StringIO()) as said:
            paths = results.plot()
        self.check(paths, ["damage_0002.png", "displacement_0002.png", "stress_0002.png",
                           "load_displacement.png", "reactions.png", "tips.png", "energies.png",
                           "probes.png"])
        self.assertIn("left out: velocity (zero)", said.getvalue())
        self.assertEqual(said.getvalue().count("wrote"), len(paths))

    def test_static(self):
        results = self.results((30, 20), static=True)
        self.check(results.plot(quiet=True, component="x"), ["displacement_x_0002.png"])
        self.assertEqual(View(results).caption(1), "made, load factor 0.5, displacements \u00d7 50")
        # The largest displacement, 2e-3 x 14.5 mm, is then 5 % of 29 mm
        self.assertEqual(worth_drawing(results)[1], {"velocity": "statics have none"})
        # Their axis is the load factor, not the number of the iteration
        figure = pictures.curve_pictures([results])["energies"]
        self.assertEqual(figure.axes[-1].get_xlabel(), "load factor")
        self.assertEqual(len(figure.axes), 1)

    def test_solid(self):
        results = self.results((12, 8, 6))
        self.check(results.plot(quiet=True, field=["damage", "displacement"]),
                   ["damage_0002.png", "displacement_0002.png"])
        self.check(results.plot(quiet=True, field="stress_xx", clip="y=0.004",
                                to=self.folder / "c"), ["stress_xx_0002.png"])
        with self.assertRaisesRegex(ValueError, "misses the body"):
            results.plot(quiet=True, field="damage", clip="y=1")

    def test_line_is_signed(self):
        results = self.results((20,))
        self.check(results.plot(quiet=True, field="displacement"), ["displacement_0002.png"])
        figure = figure_of(View(results), names_of(results, "displacement"), 2)
        drawn = figure.axes[0].lines[0].get_ydata()
        self.assertLess(drawn.min(), 0.0)
        self.assertAlmostEqual(drawn.max(), 2e-3 * 9.5e-3 * 1e6, places=6)
        self.assertEqual(figure.axes[0].get_ylabel(), "displacement x [\u00b5m]")

    def test_colours_are_those_of_all_outputs(self):
        view = View(self.results((30, 20)))
        for output in range(3):
            figure = figure_of(view, ["stress_xx"], output)
            # 2 x 100 MPa x (1 + 1/2) at the last output's upper edge
            low, high = figure.axes[0].collections[0].get_clim()
            self.assertEqual(low, 0.0)
            self.assertAlmostEqual(high, 300.0, places=6)
            self.assertEqual(figure.axes[1].get_ylabel().splitlines()[0], "stress xx [MPa]")

    def test_broken_points_set_no_limits(self):
        fields = fields_of(lattice((30, 20)))
        damage, stress = fields["damage"][2], fields["stress"][2]
        stress[damage > 0.3] *= 50.0
        found = View(self.results((30, 20), fields=fields)).colours("stress_xx")
        self.assertAlmostEqual(found.high, 3e8, delta=1.0)
        self.assertEqual((found.extend, found.note), ("max", "points of damage < 0.3"))

    def test_fragments_keep_their_colour(self):
        points = lattice((30, 20))
        number = np.ones((3, 600))
        number[1:, points[:, 0] > 0.015] = 16.0
        number[2, 0] = 7.0
        results = self.results((30, 20), fields={"fragment": ("1", "", number)})
        self.assertEqual(set(values_of(results, "fragment", 1)), {0.0, 15.0})
        last = values_of(results, "fragment", 2)
        self.assertTrue(np.isnan(last[0]))
        self.assertEqual(set(last[1:]), {0.0, 15.0})
        self.check(results.plot(field="fragment", quiet=True), ["fragment_0002.png"])

    def test_layers_are_not_drawn(self):
        layer = np.zeros(600, dtype="i4")
        layer[:60] = 1
        figure = figure_of(View(self.results((30, 20), layer=layer)), ["damage"], 2)
        self.assertEqual(len(figure.axes[0].collections[0].get_paths()), 540)
        self.assertGreater(figure.axes[0].get_ylim()[0], 1e-3)

    def test_no_white_lines(self):
        # A body of one colour: no lighter line between its cells, whatever their size in pixels
        for count in (7, 33, 90, 200):
            points = lattice((count, count))
            fields = {"damage": ("1", "", np.ones((3, len(points)))),
                      "displacement": ("m", "x y z", fields_of(points)["displacement"][2])}
            path = write_results(self.folder / f"one{count}.vtkhdf", points, fields=fields)
            figure = figure_of(View(perifort.open(path)), ["damage"], 2)
            image = pictures.film.image_of(figure)
            box = figure.axes[0].get_position()
            rows, columns = image.shape[:2]
            inside = image[int(rows * (1 - box.y1)) + 16:int(rows * (1 - box.y0)) - 16,
                           int(columns * box.x0) + 16:int(columns * box.x1) - 16]
            with self.subTest(count=count):
                self.assertGreater(inside.size, 10000)
                self.assertEqual(int(inside.max()), int(inside.min(axis=(0, 1)).max()))

    def test_clouds(self):
        for dimension in (2, 3):
            points = np.zeros((400, 3))
            points[:, :dimension] = np.random.default_rng(dimension).random((400, dimension)) * 0.02
            path = write_results(self.folder / f"cloud{dimension}.vtkhdf", points,
                                 fields=fields_of(points))
            results = perifort.open(path)
            self.assertIsNone(cells.parts_of(results)[0].lattice)
            self.check(results.plot(field="displacement", quiet=True, to=self.folder / "c"),
                       ["displacement_0002.png"])

    def test_many_cells_are_an_image_without_gaps(self):
        points = lattice((60, 40))
        fields = fields_of(points)
        fields["displacement"][2][2] *= 40.0
        path = write_results(self.folder / "many.vtkhdf", points, fields=fields)
        with mock.patch("perifort.pictures.fields.MOST_CELLS", 1000):
            figure = figure_of(View(perifort.open(path), deform=1.0), ["damage"], 2)
        shown = figure.axes[0].images[0].get_array()
        self.assertFalse(np.ma.getmaskarray(shown)[2:-2, 2:-2].any())
        self.assertEqual(float(shown.max()), 0.4)

    def test_pyvista_draws_the_same(self):
        try:
            import pyvista  # noqa: F401
        except ImportError:
            self.skipTest("pyvista is not installed")
        results = self.results((12, 8, 6))
        for render in ("matplotlib", "pyvista"):
            self.check(results.plot(quiet=True, field="displacement_x", render=render),
                       ["displacement_x_0002.png"])
        mesh = results.to_pyvista(time=1e-5, deform=2.0)
        self.assertEqual(mesh.n_points, len(results.points))
        self.assertTrue(np.allclose(mesh.point_data["stress"], results.field("stress", 1)))
        self.assertTrue(np.allclose(mesh.points, results.points
                                    + 2.0 * results.field("displacement", 1)))

    def test_components(self):
        results = self.results((30, 20))
        self.assertEqual(names_of(results, "displacement"), ["displacement_x", "displacement_y"])
        self.assertEqual(names_of(results, "stress"), ["stress_xx"])
        self.assertEqual(names_of(results, "stress", "xy"), ["stress_xy"])
        u = results.field("displacement")
        self.assertTrue(np.allclose(values_of(results, "displacement_magnitude"),
                                    np.linalg.norm(u, axis=1)))
        # Off the diagonal each component stands for two
        shear = np.zeros((3, 600, 6))
        shear[..., 3] = 3.0
        other = self.results((30, 20), name="shear", fields={"stress": (
            "Pa", "xx yy zz xy yz xz", shear)})
        self.assertAlmostEqual(values_of(other, "stress_magnitude")[0], 3.0 * np.sqrt(2))
        for field, component, message in (
                ("stres", None, r"no field 'stres' \(did you mean 'stress'\?\)"),
                ("stress", "xw", "has no component 'xw'.*it has xx"),
                ("damage", "x", "no components"), ("displacement_x", "y", "not the component y")):
            with self.subTest(field=field), self.assertRaisesRegex(KeyError, message):
                results.plot(field=field, component=component, quiet=True)
        with self.assertRaisesRegex(KeyError, "no field of made.vtkhdf has a component 'q'"):
            results.plot(component="q", quiet=True)

    def test_output_and_time(self):
        results = self.results((10, 10))
        self.check(results.plot(field="damage", time=0.9e-5, quiet=True), ["damage_0001.png"])
        self.check(results.plot(field="damage", output="all", quiet=True),
                   [f"damage_000{k}.png" for k in range(3)])
        with self.assertRaisesRegex(ValueError, "not by both"):
            results.plot(field="damage", time=1e-5, output=1, quiet=True)
        with self.assertRaisesRegex(ValueError, "a film shows all outputs"):
            results.plot(field="damage", film="gif", output=1, quiet=True)

    def test_clip(self):
        self.assertEqual(Clip.parse("y"), Clip(1, None))
        self.assertEqual(Clip.parse("z=-0.5"), Clip(2, -0.5))
        for text in ("w", "x=", "y=a"):
            if text != "x=":
                with self.assertRaises(ValueError):
                    Clip.parse(text)

    def test_films(self):
        import imageio_ffmpeg
        from PIL import Image
        results = self.results((12, 10))
        gif, = results.plot(film="gif", quiet=True)
        self.assertEqual(gif.name, "damage.gif")
        with Image.open(gif) as film:
            self.assertEqual(film.n_frames, 3)
        mp4, = results.plot(film="mp4", field="displacement", quiet=True)
        frames, _ = imageio_ffmpeg.count_frames_and_secs(str(mp4))
        self.assertEqual(frames, 3)
        reader = imageio_ffmpeg.read_frames(str(mp4))
        size = next(reader)["size"]
        images = [np.frombuffer(frame, dtype=np.uint8).reshape(size[1], size[0], 3)
                  for frame in reader]
        self.assertGreater(np.abs(images[0].astype(int) - images[2]).max(), 50)
        self.assertEqual(len(list(results.folder.glob("*part*"))), 0)

    def test_pdf(self):
        results = self.results((12, 10))
        path, = results.plot(field="damage", pdf=True, quiet=True)
        self.assertEqual(path.read_bytes()[:5], b"%PDF-")

    def test_compare(self):
        first, second = self.results((12, 10)), self.results((12, 10), name="second")
        self.check(pictures.compare_results(first, second, quiet=True),
                   ["compared_damage_0002.png", "compared_displacement_0002.png",
                    "compared_stress_0002.png", "compared_load_displacement.png",
                    "compared_reactions.png", "compared_tips.png", "compared_energies.png",
                    "compared_probes.png"])
        other = self.results((8, 6, 4), name="third")
        with self.assertRaisesRegex(ValueError, "2 dimensions"):
            pictures.compare_results(first, other, quiet=True)

    def test_panels_keep_their_shape(self):
        for shape in (0.05, 0.4, 1.0, 3.0, 20.0):
            figure, ((place,),) = lay_out([[Panel(shape)]], 4.0)
            width, height = figure.get_size_inches()
            box = place.axes.get_position()
            self.assertAlmostEqual(box.height * height / (box.width * width), shape, places=6)
            self.assertLessEqual(width, 4.0 + 1e-9)
            for inside in (box, place.bar.get_position()):
                self.assertGreaterEqual(inside.x0, 0.0)
                self.assertLessEqual(inside.x1, 1.0)


if __name__ == "__main__":
    unittest.main()
