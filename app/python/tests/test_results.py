"""Reading of results."""
import pickle
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np
import perifort
from perifort.results import Quantity

from .synthetic import write_results


class TestResults(unittest.TestCase):
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory())
                           if hasattr(self, "enterContext") else tempfile.mkdtemp())
        self.path = write_results(self.folder / "made.vtkhdf", spare=2)
        self.results = perifort.open(self.folder)

    def test_counts(self):
        r = self.results
        self.assertEqual((r.name, r.outputs, r.dimension, len(r.points)), ("made", 3, 2, 24))
        self.assertEqual(r.fields, ["damage", "displacement"])
        self.assertEqual(list(r.times), [0.0, 1e-5, 2e-5])
        self.assertFalse(r.static)
        self.assertTrue(r.body.all())

    def test_rows_that_are_not_complete_are_left_out(self):
        self.assertEqual(len(self.results.history["time"]), 5)
        self.assertTrue(np.isfinite(self.results.history["time"]).all())

    def test_field(self):
        r, n = self.results, 24
        self.assertEqual(list(r.field("damage", 1)), list(range(n, 2 * n)))
        self.assertEqual(list(r.field("damage")), list(range(2 * n, 3 * n)))
        self.assertEqual(list(r.field("damage", -3)), list(range(n)))
        self.assertEqual(list(r.field("damage", time=0.9e-5)), list(range(n, 2 * n)))
        self.assertEqual(list(r.field("damage", 0.9e-5)), list(range(n, 2 * n)))
        self.assertEqual(r.field("displacement", 0).shape, (n, 3))
        self.assertEqual(list(r.field("displacement_y", 0)), list(range(1, 3 * n, 3)))
        self.assertEqual(r.field("displacement_y", 0).unit, "m")

    def test_wrong_field(self):
        with self.assertRaisesRegex(KeyError, "did you mean 'damage'.*it has damage, displacement"):
            self.results.field("damge")
        with self.assertRaisesRegex(KeyError, "displacement_x"):
            self.results.field("displacement_w")

    def test_wrong_output(self):
        with self.assertRaisesRegex(IndexError, "it has 3"):
            self.results.field("damage", 3)
        with self.assertRaisesRegex(ValueError, "between 0 and 2e-05 s"):
            self.results.field("damage", time=3e-5)

    def test_units(self):
        force = self.results.history["grip_reaction_x"]
        self.assertEqual((force.unit, force.name), ("N", "grip_reaction_x"))
        self.assertEqual(force[1:3].unit, "N")
        # A product may have another unit
        self.assertNotIsInstance(force * force, Quantity)
        self.assertNotIsInstance(np.abs(force), Quantity)
        self.assertEqual(float(force.max()), 1e4)
        self.assertEqual(pickle.loads(pickle.dumps(force)).unit, "N")
        force += 1.0
        self.assertEqual(float(np.max(force)), 1e4 + 1)

    def test_unknown_column(self):
        with self.assertRaisesRegex(KeyError, "did you mean 'strain_energy'"):
            self.results.history["strain_enrgy"]

    def test_probes(self):
        self.assertEqual(self.results.probes, ["end", "end_b"])
        # end_b_displacement_x begins with end_, too
        self.assertEqual(list(self.results.probe("end")), ["time", "displacement_x"])
        self.assertEqual(float(self.results.probe("end").displacement_x[0]), 4.0)
        self.assertEqual(float(self.results.probe("end_b")["displacement_x"][0]), 6.0)
        with self.assertRaisesRegex(KeyError, "there are end, end_b"):
            self.results.probe("begin")

    def test_boundary(self):
        self.assertEqual(self.results.boundaries, ["grip"])
        self.assertEqual(self.results.boundary("grip").displacement_x.unit, "m")

    def test_tip(self):
        self.assertEqual(self.results.tips, ["notch"])
        tip = self.results.tip("notch")
        self.assertEqual(list(tip), ["time", "x", "y", "length", "projection", "speed", "branches"])
        self.assertEqual(tip.speed.unit, "m/s")
        with self.assertRaisesRegex(AttributeError, "no column 'z'"):
            tip.z

    def test_line(self):
        path = write_results(self.folder / "lines" / "lines.vtkhdf")
        with h5py.File(path, "a") as file:
            line = file.create_group("lines/cut")
            line["position"] = np.array([[0.0, 1.0], [3.0, 5.0]])
            line["damage"] = np.arange(6.0).reshape(3, 2, 1)
            line["stress"] = np.arange(24.0).reshape(3, 2, 4)
            line["stress"].attrs["units"] = np.bytes_("Pa")
        results = perifort.open(path.parent)
        self.assertEqual(results.lines, ["cut"])
        cut = results.line("cut", 1)
        self.assertEqual(cut.distance.tolist(), [0.0, 5.0])
        self.assertEqual(cut.damage.tolist(), [2.0, 3.0])
        self.assertEqual((cut.stress.shape, cut.stress.unit, cut.stress[1, 3]), ((2, 4), "Pa", 15.0))
        with self.assertRaisesRegex(KeyError, "no line 'cat'.*there are cut"):
            results.line("cat")

    def test_no_results(self):
        empty = self.folder / "empty"
        empty.mkdir()
        with self.assertRaisesRegex(FileNotFoundError, "holds no results"):
            perifort.open(empty)
        with self.assertRaisesRegex(FileNotFoundError, "no folder"):
            perifort.open(self.folder / "other")
        write_results(self.folder / "second.vtkhdf")
        with self.assertRaisesRegex(FileNotFoundError, "2 files.*made.vtkhdf, second.vtkhdf"):
            perifort.open(self.folder)
        self.assertEqual(perifort.open(self.folder / "second.vtkhdf").name, "second")

    def test_balance(self):
        # Energies are t + t + t, the work 3 t
        self.assertLess(self.results.balance(), 1e-15)


if __name__ == "__main__":
    unittest.main()
