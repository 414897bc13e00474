"""Runs of the program, which $PERIFORT names or ./pf has built."""
import contextlib
import io
import os
import re
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import perifort
from perifort.reference import known_reference


def bar(points=40, steps=50):
    """A bar fixed at its left end and stretched at the start."""
    scene = perifort.Scene("bar")
    scene.add("scene", dimension=1, area=1e-4)
    scene.add("body", lower=[0.0], upper=[1.0], points=[points])
    scene.add("material", youngs_modulus=200e9, density=7850.0)
    scene.add("boundary", name="wall", side="x_min", displacement_x=0.0)
    scene.add("initial", displacement_gradient=[1e-3])
    scene.add("time", steps=steps)
    scene.add("output", every=10, fields=["displacement"])
    scene.add("probe", name="end", point=[1.0])
    return scene


class TestRun(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def test_scene_to_results(self):
        lines = []
        results = perifort.run(bar(), self.folder / "bar", threads=1, progress=lines.append)
        self.assertEqual(results.outputs, 6)
        self.assertRegex(lines[-1], r"^100\.0 %.*step 50/50")
        self.assertEqual(results.probe("end").displacement_x.unit, "m")
        self.assertEqual(results.boundary("wall").reaction_x.unit, "N")
        # The wall holds the bar by about E A strain = 20 kN until the wave from
        # the free end is there
        early = results.history["time"] < 0.5 / np.sqrt(200e9 / 7850)
        force = np.abs(results.history["wall_reaction_x"][early][1:])
        self.assertAlmostEqual(float(np.median(force)), 20e3, delta=1e3)

    def test_results_are_not_overwritten(self):
        perifort.run(bar(steps=2), self.folder, progress=False)
        with self.assertRaises(perifort.RunError) as caught:
            perifort.run(bar(steps=2), self.folder, progress=False)
        self.assertEqual(caught.exception.status, 1)
        self.assertIn("results exist already", caught.exception.message)
        perifort.run(bar(steps=2), self.folder, progress=False, overwrite=True)

    def test_message_of_the_program(self):
        scene = bar()
        scene["body"]["points"] = [0]
        with self.assertRaisesRegex(perifort.RunError, "status 1[^$]*points"):
            perifort.run(scene, self.folder)

    def test_file_of_a_scene(self):
        path = bar(steps=2).write(self.folder / "mine.nml")
        results = perifort.run(path, self.folder / "out", progress=False)
        self.assertEqual((results.name, results.folder.name), ("mine", "out"))

    def test_files_that_a_scene_names(self):
        (self.folder / "cloud.txt").write_text("\n".join(f"{0.05 + 0.1 * i} 0 0 1e-5"
                                                         for i in range(10)))
        scene = bar(steps=2)
        scene["body"].clear()
        scene["body"]["file"] = "cloud.txt"
        scene.remove(scene["boundary"])
        scene.write(self.folder / "bar.nml")
        read = perifort.Scene.read(self.folder / "bar.nml")
        results = perifort.run(read, self.folder / "elsewhere", progress=False)
        self.assertEqual(len(results.points), 10)
        self.assertEqual(read["body"]["file"], "cloud.txt")

    def test_progress_on_a_line(self):
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            perifort.run(bar(steps=2), self.folder)
        self.assertIn("\r100.0 %", text.getvalue())

    def test_interrupt_leaves_a_checkpoint(self):
        def interrupt(line):
            raise KeyboardInterrupt
        with self.assertRaises(perifort.RunError) as caught:
            perifort.run(bar(points=2000, steps=10000000), self.folder, threads=1,
                         progress=interrupt)
        self.assertEqual(caught.exception.status, 4)
        self.assertTrue(list(self.folder.glob("*.checkpoint")))

    def test_program(self):
        with self.assertRaisesRegex(FileNotFoundError, "argument"):
            perifort.find_program(self.folder / "none")
        with mock.patch.dict(os.environ, PERIFORT=str(self.folder / "none")), \
                self.assertRaisesRegex(FileNotFoundError, "PERIFORT"):
            perifort.find_program()

    def test_reference_is_that_of_the_program(self):
        self.assertEqual(perifort.reference(), known_reference())
        page = Path(__file__).resolve().parents[3] / "doc" / "input-reference.md"
        self.assertEqual(perifort.Reference.parse(page.read_text(encoding="utf-8")),
                         perifort.reference())

    def test_the_lines_of_the_guide(self):
        guide = (Path(__file__).resolve().parents[3] / "doc/user-guide.md").read_text("utf-8")
        scene = re.search(r"```fortran\n(! strip\.nml.*?)```", guide, re.S).group(1)
        lines = re.search(r"```python\n(import matplotlib.*?import perifort.*?)```", guide,
                          re.S).group(1)
        self.assertLessEqual(len(lines.splitlines()), 10)
        (self.folder / "strip.nml").write_text(scene, encoding="utf-8")
        before = Path.cwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, before)
        found = {}
        with contextlib.redirect_stdout(io.StringIO()), mock.patch.dict(os.environ,
                                                                        MPLBACKEND="agg"):
            exec(lines, found)
        self.assertTrue((self.folder / "strip.png").is_file())
        # p h t = 80 MPa 40 mm 2 mm, and p L / E up to the probe, half a spacing from the end
        self.assertAlmostEqual(float(-found["force"][-1]), 6400.0, delta=1.0)
        self.assertAlmostEqual(float(found["end"][-1]), 80e6 / 70e9 * 0.1, delta=2e-6)
        self.assertEqual(len(found["force"]), 11)

    def test_sweep(self):
        table = perifort.sweep(bar(steps=2), {"body%points": [[20], [40]]}, horizon__ratio=[2, 3],
                               measure=lambda r: {"points": len(r.points), "end": r.times[-1]},
                               folder=self.folder, progress=False)
        self.assertEqual(table.columns, ["body%points", "horizon%ratio", "points", "end"])
        self.assertEqual(list(table["horizon%ratio"]), [2, 3, 2, 3])
        # With the layer of the wall, which is as wide as the horizon
        self.assertEqual(list(table["points"]), [22, 23, 42, 43])
        self.assertEqual(len(str(table).splitlines()), 5)
        self.assertEqual(table.write(self.folder / "t.csv").read_text().splitlines()[0],
                         "body%points,horizon%ratio,points,end")
        self.assertEqual([row["points"] for row in table], [22, 23, 42, 43])

    def test_sweep_that_fails(self):
        options = {"folder": self.folder, "progress": False, "measure": lambda r: 1.0}
        with self.assertRaises(perifort.SceneError):
            perifort.sweep(bar(), horizon__ratoi=[2], **options)
        with self.assertRaises(perifort.RunError):
            perifort.sweep(bar(steps=2), horizon__ratio=[0.1], **options)
        table = perifort.sweep(bar(steps=2), horizon__ratio=[0.1, 3], keep_going=True,
                               overwrite=True, **options)
        self.assertTrue(np.isnan(table["value"][0]))
        self.assertIsNone(table.results[0])
        self.assertIn("ratio", table.errors[0])
        self.assertEqual(table["value"][1], 1.0)
        with self.assertRaisesRegex(ValueError, "at least one key"):
            perifort.sweep(bar())


if __name__ == "__main__":
    unittest.main()
