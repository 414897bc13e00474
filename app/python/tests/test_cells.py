"""Results with the elements of meshes: by h5py, by VTK's readers and in pictures."""
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np
import perifort
import perifort.pictures
from perifort.pictures import elements

try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
except ImportError:
    vtkHDFReader = None

# By Gmsh's number of a type: VTK's kind, corners, the edges with a middle node (Gmsh's manual, node
# ordering), faces with one
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
CUBE = SQUARE + [(x, y, 1) for x, y, _ in SQUARE]
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
WEDGE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
PYRAMID = [*SQUARE, (0.5, 0.5, 1)]
QUAD_EDGES = ["01", "12", "23", "30"]
HEX_EDGES = ["01", "03", "04", "12", "15", "23", "26", "37", "45", "47", "56", "67"]
HEX_FACES = ["0321", "0154", "0473", "1265", "2376", "4567"]
TYPES = {
    2: {2: (5, SQUARE[:3], []), 9: (22, SQUARE[:3], ["01", "12", "20"]), 3: (9, SQUARE, []),
        16: (23, SQUARE, QUAD_EDGES), 10: (28, SQUARE, [*QUAD_EDGES, "0123"])},
    3: {4: (10, TETRAHEDRON, []), 11: (24, TETRAHEDRON, ["01", "12", "20", "30", "23", "13"]),
        5: (12, CUBE, []), 17: (25, CUBE, HEX_EDGES),
        12: (29, CUBE, [*HEX_EDGES, *HEX_FACES, "01234567"]), 6: (13, WEDGE, []),
        18: (26, WEDGE, ["01", "02", "03", "12", "14", "25", "34", "35", "45"]),
        7: (14, PYRAMID, [])}}


def blocks(dimension, rows=2):
    """Some elements of every type, each a block of its own: nodes, and (type, nodes, kind)."""
    nodes, found = [], []
    for block, (number, (kind, corners, others)) in enumerate(TYPES[dimension].items()):
        for i in range(rows):
            corner = np.array(corners, dtype=float) + [1.5 * block, float(i), 0.0]
            own = [*corner, *[corner[[int(c) for c in word]].mean(axis=0) for word in others]]
            found.append((number, list(range(len(nodes), len(nodes) + len(own))), kind))
            nodes += own
    # Sheared, so that no two directions are alike
    return np.array(nodes) @ np.array([[1, 0, 0], [0.1, 1.1, 0], [0.05, 0.15, 0.9]]), found


def joined(dimension, numbers, counts):
    """A block of cells of one type after another along x, which share their nodes."""
    nodes, place, found = [], {}, []
    for i in np.ndindex(*counts[:dimension]):
        number = numbers[min(len(numbers) - 1, i[0] * len(numbers) // counts[0])]
        kind, corners, others = TYPES[dimension][number]
        corner = np.array(corners, dtype=float) + [*i, *[0] * (3 - dimension)]
        own = []
        for x in [*corner, *[corner[[int(c) for c in word]].mean(axis=0) for word in others]]:
            key = tuple(np.round(2 * x).astype(int))
            if key not in place:
                place[key] = len(nodes)
                nodes.append(x)
            own.append(place[key])
        found.append((number, own, kind))
    return np.array(nodes) @ np.array([[1, 0, 0], [0.1, 1.1, 0], [0.05, 0.15, 0.9]]), found


def write_mesh(path, nodes, found):
    """A mesh in Gmsh's format 2.2."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    lines += [f"{i + 1} {x:.17g} {y:.17g} {z:.17g}" for i, (x, y, z) in enumerate(nodes)]
    lines += ["$EndNodes", "$Elements", str(len(found))]
    lines += [f"{i + 1} {number} 0 " + " ".join(str(n + 1) for n in own)
              for i, (number, own, _) in enumerate(found)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def gradient(dimension):
    """A displacement gradient (3, 3) without symmetry."""
    found = np.zeros((3, 3))
    found[:dimension, :dimension] = 1e-3 * np.arange(1.0, dimension**2 + 1).reshape(
        dimension, dimension)
    return found


def arrays(data):
    """The arrays of VTK's point or cell data by name."""
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i))
            for i in range(data.GetNumberOfArrays())}


class TestCells(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def run_blocks(self, dimension, mesh=None, lattice=False, steps=3, arguments=(), **output):
        """A body of all types of elements, or another mesh, with a linear displacement, and with
        `lattice` a lattice with a layer beside it.
        """
        nodes, found = blocks(dimension) if mesh is None else mesh
        write_mesh(self.folder / "mesh.msh", nodes, found)
        scene = perifort.Scene("cells")
        scene.add("scene", dimension=dimension, **({"thickness": 1.0} if dimension == 2 else {}))
        scene.add("body", name="mesh", mesh=str(self.folder / "mesh.msh"))
        if lattice:
            scene.add("body", name="lattice", lower=[0.0, -9.0, 0.0][:dimension],
                      upper=[4.0, -5.0, 4.0][:dimension], points=[4] * dimension)
            scene.add("boundary", body="lattice", side="y_min", displacement_y=0.0)
        scene.add("material", youngs_modulus=1e9, poissons_ratio=0.25, density=1000.0)
        scene.add("horizon", length=1.6)
        scene.add("initial", displacement_gradient=list(gradient(dimension).ravel("F")))
        scene.add("time", steps=steps, step=1e-6)
        scene.add("output", **{"every": 1, "cells": True, "fields": [
            "displacement", "damage", "stress", "fragment"], **output})
        return perifort.run(scene, self.folder / "out", progress=False, threads=1,
                            arguments=arguments), nodes, found

    def test_values_of_nodes_and_cells(self):
        """A linear field is found again at nodes and centres; other fields are means."""
        for name, dimension, numbers, counts in (
                ("2D", 2, [3, 16, 10], (6, 4)), ("3D", 3, [17], (4, 4, 3)), ("thin", 3, [5], (4, 5, 1)),
                ("mixed", 3, [12], (3, 3, 3))):
            with self.subTest(name):
                mesh = joined(dimension, numbers, counts)
                self.folder = self.folder / name
                self.folder.mkdir()
                results, nodes, found = self.run_blocks(dimension, mesh)
                self.assertEqual(list(results.cells.types), [kind for _, _, kind in found])
                np.testing.assert_allclose(results.cells.nodes, nodes, atol=1e-15)
                u = np.asarray(results.field("displacement", 0, of="nodes"))
                expected = nodes @ gradient(dimension).T
                if name == "thin":
                    # One layer of points: no slope across it
                    middle = nodes.copy()
                    middle -= np.outer(nodes[:, 2] / 0.9 - 0.5, [0.05, 0.15, 0.9])
                    self.assertLess(np.abs(u - expected).max(), 0.5 * 0.9 * 1e-3 * 10 + 2e-3)
                    u, expected = u[:, :2], (middle @ gradient(dimension).T)[:, :2]
                    np.testing.assert_allclose(np.ptp(u, axis=0), np.ptp(expected, axis=0), rtol=0.2)
                    continue
                np.testing.assert_allclose(u, expected, atol=1e-12 * np.abs(expected).max())
                # One point of each element: its value is the element's
                for field in results.fields:
                    np.testing.assert_array_equal(results.field(field, 2, of="cells"),
                                                  results.field(field, 2))
                # Other fields: at a node the mean of the elements around it
                values, volume = np.asarray(results.field("stress", 3)), results.volume
                for node in range(0, len(nodes), 7):
                    around = [e for e, (_, own, _) in enumerate(found) if node in own]
                    np.testing.assert_allclose(
                        results.field("stress", 3, of="nodes")[node],
                        volume[around] @ values[around] / volume[around].sum(),
                        rtol=1e-12, atol=1e-12 * np.abs(values).max())
                numbers_of_parts = results.field("fragment", 3, of="nodes")
                self.assertTrue(np.all(numbers_of_parts == 1.0))

    def test_means_of_gauss_points(self):
        """The value of a cell is the mean of its points by volume."""
        nodes, found = blocks(2)
        found = [entry for entry in found if entry[0] == 10]
        used = sorted(sum((own for _, own, _ in found), []))
        nodes = nodes[used] - nodes[used].min(axis=0)
        # A curved side, so that volumes differ
        nodes[used.index(found[0][1][5]), 0] += 0.15
        found = [(number, [used.index(n) for n in own], kind) for number, own, kind in found]
        write_mesh(self.folder / "mesh.msh", nodes, found)
        scene = perifort.Scene("gauss")
        scene.add("scene", dimension=2, thickness=1.0)
        scene.add("body", name="mesh", mesh=str(self.folder / "mesh.msh"), points_per_element=4)
        scene.add("material", youngs_modulus=1e9, poissons_ratio=0.25, density=1000.0)
        scene.add("horizon", length=2.0)
        scene.add("initial", displacement_gradient=[1e-3, 2e-3, 0.0, 0.0, -1e-3], velocity_x="x*y")
        scene.add("time", steps=1, step=1e-6)
        scene.add("output", cells=True, fields=["velocity", "energy_density"])
        results = perifort.run(scene, self.folder / "out", progress=False)
        for name in ("velocity", "energy_density"):
            values = np.asarray(results.field(name))
            weights = results.volume.reshape(2, 4)
            self.assertGreater(np.ptp(weights[0]), 0.01 * weights[0].mean())
            shape = (2, 4, *values.shape[1:])
            expected = np.einsum("ep,ep...->e...", weights, values.reshape(shape)) \
                / weights.sum(axis=1).reshape(2, *[1] * (values.ndim - 1))
            np.testing.assert_allclose(results.field(name, of="cells"), expected, rtol=1e-13,
                                       atol=1e-13 * np.abs(expected).max())

    @unittest.skipIf(vtkHDFReader is None, "needs the package vtk")
    def test_vtk(self):
        """Both of VTK's readers show each element with its nodes where VTK expects them."""
        for dimension in (2, 3):
            for precision in ("double", "single"):
                with self.subTest(dimension=dimension, precision=precision):
                    holder = tempfile.TemporaryDirectory()
                    self.addCleanup(holder.cleanup)
                    self.folder = Path(holder.name)
                    results, _, found = self.run_blocks(dimension, lattice=True,
                                                        precision=precision)
                    self.check_readers(results, found)

    def check_readers(self, results, found):
        path = results.path
        with h5py.File(path, "r") as file:
            points = file["VTKHDF/Points"][:]
            steps = int(file["VTKHDF/Steps"].attrs["NSteps"])
            total = len(file["VTKHDF/Types"])
            point_data = {name: data[:] for name, data in file["VTKHDF/PointData"].items()}
            cell_data = {name: data[:] for name, data in file["VTKHDF/CellData"].items()}
        self.assertEqual(steps, 4)
        self.assertGreater(int((results.layer > 0).sum()), 0)
        vertices = int((~results.cells.of_mesh).sum())
        self.assertEqual(vertices, len(results.points) - len(found))
        self.assertEqual(total, len(found) + vertices)
        hdf = vtkHDFReader()
        self.assertTrue(hdf.CanReadFile(str(path)))
        hdf.SetFileName(str(path))
        hdf.UpdateInformation()
        self.assertEqual(hdf.GetNumberOfSteps(), steps)
        xdmf = vtkXdmfReader()
        xdmf.SetFileName(str(path.with_suffix(".xdmf")))
        xdmf.UpdateInformation()
        for k in range(steps):
            hdf.SetStep(k)
            hdf.Update()
            xdmf.UpdateTimeStep(results.times[k])
            for output in (hdf.GetOutput(), xdmf.GetOutputDataObject(0)):
                self.assertEqual(output.GetNumberOfCells(), total)
                np.testing.assert_array_equal(vtk_to_numpy(output.GetPoints().GetData()), points)
                self.check_elements(output, found)
                seen = arrays(output.GetPointData()), arrays(output.GetCellData())
                for name in ("displacement", "damage", "fragment"):
                    for data, shown in zip((point_data, cell_data), seen):
                        n = len(data[name]) // steps
                        np.testing.assert_array_equal(shown[name], data[name][k * n:(k + 1) * n])
            np.testing.assert_array_equal(
                seen[1]["stress_xy"], results_component(results, cell_data, "stress", "xy", k))

    def check_elements(self, output, found):
        """Middle nodes lie in the middle of VTK's own edges and faces, and volumes are right."""
        for i, (_, own, kind) in enumerate(found):
            cell = output.GetCell(i)
            self.assertEqual((cell.GetCellType(), cell.GetNumberOfPoints()), (kind, len(own)))
            for part, corners in [(cell.GetEdge(e), 2) for e in range(cell.GetNumberOfEdges())] + \
                    [(cell.GetFace(f), 4) for f in range(cell.GetNumberOfFaces())]:
                x = vtk_to_numpy(part.GetPoints().GetData())
                if corners == 2 and len(x) == 3:
                    np.testing.assert_allclose(x[2], (x[0] + x[1]) / 2, atol=1e-14)
                if len(x) == 9:
                    np.testing.assert_allclose(x[8], x[:4].mean(axis=0), atol=1e-14)
            if kind == 29:
                x = vtk_to_numpy(cell.GetPoints().GetData())
                np.testing.assert_allclose(x[26], x[:8].mean(axis=0), atol=1e-14)

    def test_shapes_that_are_drawn(self):
        """Polygons and outer faces enclose the area and volume of the elements; cuts their section.
        """
        results, _, _ = self.run_blocks(2)
        cells = results.cells
        corners, which = elements.polygons(cells, cells.nodes[:, :2])
        x, y = corners[:, :, 0], corners[:, :, 1]
        area = 0.5 * np.abs(np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1))
        np.testing.assert_allclose(area[np.argsort(which)], results.volume, rtol=1e-13)
        for file in (self.folder / "out").iterdir():
            file.unlink()
        results, _, _ = self.run_blocks(3)
        cells = results.cells
        faces, which = elements.outer_faces(cells, cells.nodes, np.ones(len(cells), dtype=bool))
        vector = 0.5 * np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
        # The divergence theorem with x/3: exact for flat faces
        share = np.sum(faces[:, [0, 1, 2, 3]].mean(axis=1) * vector, axis=1) / 3
        triangle = np.all(faces[:, 2] == faces[:, 3], axis=1)
        share[triangle] = np.sum(faces[triangle, :3].mean(axis=1) * vector[triangle], axis=1) / 3
        volume = np.bincount(which, share, len(cells))
        np.testing.assert_allclose(volume, results.volume, rtol=1e-12)
        at = 0.301
        cut, which = elements.cut_of(cells, cells.nodes, cells.nodes, 2, at)
        np.testing.assert_allclose(cut[:, :, 2], at, rtol=1e-13)
        x, y = cut[:, :, 0], cut[:, :, 1]
        area = np.bincount(which, 0.5 * np.abs(np.sum(
            x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1)), len(cells))
        # Prisms have the same section everywhere, tetrahedra and pyramids lose it by the square
        height = 0.9
        base = {10: 0.5, 24: 0.5, 12: 1.0, 25: 1.0, 29: 1.0, 13: 0.5, 26: 0.5, 14: 1.0}
        left = {kind: (1 - at / height)**2 if kind in (10, 24, 14) else 1.0 for kind in base}
        np.testing.assert_allclose(area, [1.1 * base[k] * left[k] for k in cells.types], rtol=1e-12)

    def test_grid_and_pictures(self):
        results, nodes, found = self.run_blocks(3, lattice=True)
        try:
            grid = results.to_pyvista(deform=1.0)
            self.assertEqual((grid.n_points, grid.n_cells), (len(nodes), len(found)))
            np.testing.assert_allclose(grid.points, nodes + results.field(
                "displacement", of="nodes"), atol=1e-12)
        except ImportError:
            pass
        pictures = results.plot(field=["displacement"], component="x", quiet=True)
        self.assertTrue(all(path.stat().st_size > 5000 for path in pictures))
        pictures = perifort.pictures.compare_results(results, results, field="stress",
                                                     component="xx", clip="z=0.4", quiet=True)
        self.assertTrue(all(path.stat().st_size > 5000 for path in pictures))

    def test_room_and_restart(self):
        """A run that is stopped and goes on, with more outputs than it had room for, has the values
        of one that was not.
        """
        whole, _, _ = self.run_blocks(2, steps=12)
        values = {(name, of): np.asarray(whole.field(name, of=of))
                  for name in ("displacement", "damage") for of in ("points", "nodes", "cells")}
        for file in (self.folder / "out").iterdir():
            file.unlink()
        self.assertEqual(whole.outputs, 13)
        short, _, _ = self.run_blocks(2, steps=2, checkpoint_every=1)
        self.assertEqual(short.outputs, 3)
        again, _, _ = self.run_blocks(2, steps=12, checkpoint_every=1,
                                      arguments=("--restart",))
        self.assertEqual(again.outputs, 13)
        for (name, of), expected in values.items():
            np.testing.assert_array_equal(again.field(name, of=of), expected)
        np.testing.assert_array_equal(again.cells.connectivity, whole.cells.connectivity)
        np.testing.assert_array_equal(again.field("displacement", 1, of="cells"),
                                      short.field("displacement", 1, of="cells"))

    def test_refusals(self):
        with self.assertRaisesRegex(perifort.RunError, "format = 'both' has no cells"):
            self.run_blocks(2, format="both")
        scene = perifort.Scene("lattice")
        scene.add("scene", dimension=1, area=1.0)
        scene.add("body", lower=[0.0], upper=[1.0], points=[10])
        scene.add("material", youngs_modulus=1e9, density=1.0)
        scene.add("time", steps=1)
        scene.add("output", cells=True)
        with self.assertRaisesRegex(perifort.RunError, "'cells' without a mesh"):
            perifort.run(scene, self.folder / "refused", progress=False)
        results, _, _ = self.run_blocks(2, cells=False)
        self.assertIsNone(results.cells)
        with self.assertRaisesRegex(KeyError, "cells = .true."):
            results.field("damage", of="nodes")


def results_component(results, data, name, component, k):
    """A component of a field of all cells at an output."""
    n = len(data[name]) // results.outputs
    return data[name][k * n:(k + 1) * n, results.components[name].index(component)]
