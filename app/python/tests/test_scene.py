"""Scenes, the input reference and their texts."""
import tempfile
import unittest
from pathlib import Path

import numpy as np
from perifort import Reference, Scene, SceneError

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "doc" / "input-reference.md").read_text(encoding="utf-8")
REFERENCE = Reference.parse(PAGE)


class TestReference(unittest.TestCase):
    def test_every_group_and_key_of_the_page(self):
        self.assertEqual(list(REFERENCE.groups), [line[4:].strip() for line in PAGE.splitlines()
                                                  if line.startswith("## &")])
        rows = [line for line in PAGE.splitlines() if line.startswith("| `")]
        self.assertEqual(sum(len(group.keys) for group in REFERENCE.groups.values()), len(rows))

    def test_types(self):
        self.assertEqual(REFERENCE.key("body", "lower").most, 3)
        self.assertEqual(REFERENCE.key("body", "lower").base, "real")
        self.assertEqual(REFERENCE.key("initial", "displacement_gradient").most, 9)
        self.assertIsNone(REFERENCE.key("output", "fields").most)
        self.assertEqual(REFERENCE.key("scene", "thickness").unit, "m")
        # A bar inside of the meaning parts no cells
        self.assertIn("|xi|", REFERENCE.key("material", "influence").meaning)
        self.assertTrue(REFERENCE.group("body").repeatable)
        self.assertFalse(REFERENCE.group("scene").repeatable)

    def test_no_page(self):
        with self.assertRaisesRegex(ValueError, "no input reference"):
            Reference.parse("nothing of that kind")


class TestScene(unittest.TestCase):
    def scene(self, text):
        return Scene.parse(text, check=REFERENCE)

    def test_values(self):
        scene = self.scene("""! a comment
&scene title = 'it''s / a "test" ! of &texts', Dimension = 2 /
&body
  lower = -0.5, 2*1.0D-3   ! repeated
  upper= +.5 3.
  4e0
  points =20 ,20
/
&material ignore_poissons_ratio = T
  poissons_ratio = 0.333333333333333 /
&output fields = 'damage', "displacement" /
&boundary /
&boundary Displacement_X = 0 /""")
        self.assertEqual(scene["scene"]["title"], "it's / a \"test\" ! of &texts")
        self.assertEqual(scene["body"]["lower"], [-0.5, 0.001, 0.001])
        self.assertEqual(scene["body"]["upper"], [0.5, 3.0, 4.0])
        self.assertEqual(scene["body"]["points"], [20, 20])
        self.assertIs(scene["material"]["ignore_poissons_ratio"], True)
        self.assertEqual(scene["output"]["fields"], ["damage", "displacement"])
        self.assertEqual(len(scene["boundary", 1]), 0)
        self.assertEqual(scene["boundary", 2]["displacement_x"], 0)
        again = self.scene(str(scene))
        self.assertEqual(again, scene)

    def test_all_scenes_of_the_project_keep_their_values(self):
        paths = [*ROOT.glob("cases/*/*.nml"), *ROOT.glob("test/scenes/*.nml"),
                 *ROOT.glob("doc/printed/*.nml")]
        self.assertGreater(len(paths), 20)
        for path in paths:
            with self.subTest(path=path.name):
                scene = Scene.read(path, check=REFERENCE)
                self.assertGreater(len(scene), 2)
                self.assertEqual(Scene.parse(str(scene), check=REFERENCE), scene)

    def test_numbers_keep_every_bit(self):
        scene = Scene(check=REFERENCE)
        numbers = [*np.random.default_rng(1).uniform(-1, 1, 200) * 10.0 ** np.arange(-100, 100),
                   0.1, 1e-30, 5e-324, 1 / 3]
        scene.add("boundary", times=numbers)
        self.assertEqual(self.scene(str(scene))["boundary"]["times"], numbers)

    def test_build(self):
        scene = Scene("strip", check=REFERENCE)
        scene.add("scene", dimension=2, title="a 'strip'")
        scene.add("body", lower=(0, 0), upper=np.array([0.1, 0.04]), points=np.array([50, 20]))
        scene.add("material", youngs_modulus=np.float64(7e10), ignore_poissons_ratio=np.True_)
        self.assertEqual(str(scene), """&scene
  dimension = 2
  title = 'a ''strip'''
/

&body
  lower = 0, 0
  upper = 0.1, 0.04
  points = 50, 20
/

&material
  youngs_modulus = 70000000000.0
  ignore_poissons_ratio = .true.
/""")
        with tempfile.TemporaryDirectory() as folder:
            path = scene.write(Path(folder) / "deep" / "strip.nml")
            self.assertEqual(Scene.read(path, check=REFERENCE), scene)
            self.assertEqual(Scene.read(path, check=REFERENCE).name, "strip")

    def test_a_word_of_python_as_key(self):
        scene = Scene(check=REFERENCE)
        scene.add("crack", from_=[0, 0], to=[1, 0])
        self.assertEqual(list(scene["crack"]), ["from", "to"])

    def test_matrix_is_written_column_by_column(self):
        scene = Scene(check=REFERENCE)
        scene.add("initial", displacement_gradient=np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]]))
        self.assertEqual(scene["initial"]["displacement_gradient"], [1, 4, 7, 2, 5, 8, 3, 6, 9])

    def test_unknown_names(self):
        scene = Scene(check=REFERENCE)
        with self.assertRaisesRegex(SceneError, "unknown group &matrial .did you mean 'material'"):
            scene.add("matrial")
        with self.assertRaisesRegex(SceneError, "unknown key 'stps'.*did you mean 'steps'"):
            scene.add("time", stps=15)
        with self.assertRaisesRegex(SceneError, r"scene:3: unknown key 'stps' in group &time"):
            self.scene("&time\n\n stps = 15 /")

    def test_bad_values(self):
        scene = Scene(check=REFERENCE)
        for group, key, value, message in (
                ("time", "steps", 1.5, "expected integer"),
                ("time", "steps", True, "expected integer"),
                ("time", "steps", [1, 2], "too many values"), ("body",
                 "lower", [0] * 4, "at most 3"),
                ("scene", "title", 3, "expected text"), ("body", "upper", [], "expected a value"),
                ("material", "density", float("nan"), "finite"), ("scene", "title", "a\nb", "line"),
                ("material", "density", {"a": 1}, "no number"),
                ("material", "break_in_compression", "yes", "expected logical")):
            with self.subTest(key=key, value=value), self.assertRaisesRegex(SceneError, message):
                scene.add(group, **{key: value})

    def test_expressions_are_texts(self):
        scene = Scene(check=REFERENCE)
        scene.add("boundary", velocity_x="200*x/sqrt(x^2+y^2)")
        self.assertIn("velocity_x = '200*x/sqrt(x^2+y^2)'", str(scene))

    def test_bad_texts(self):
        for text, message in (("&time steps = 1", "not closed"), ("time /", "outside of any group"),
                              ("&time steps = /", "has no value"), ("&time steps = , 1 /", "empty"),
                              ("&time steps = 1, , 2 /", "empty"), ("&time 15 /", "key = value"),
                              ("&scene title = 'a /", "unclosed quote"),
                              ("&scene title = abc /", "texts stand in quotes"),
                              ("&time steps = 1 steps = 2 /", "twice")):
            with self.subTest(text=text), self.assertRaisesRegex(SceneError, message):
                self.scene(text)

    def test_set(self):
        scene = self.scene("&time steps = 3 / &boundary name = 'a' / &boundary name = 'b' /")
        scene.set("time%steps", 4)
        scene.set("boundary(2)%velocity_y", 1.5)
        scene.set("horizon%ratio", 4)
        scene.set("boundary(2).displacement(2)", 4) if "displacement" in \
            REFERENCE.groups["boundary"].keys else None
        self.assertEqual(scene["time"]["steps"], 4)
        self.assertEqual(scene["boundary", "b"]["velocity_y"], 1.5)
        self.assertEqual(scene["horizon"]["ratio"], 4)
        with self.assertRaisesRegex(KeyError, "2 groups &boundary"):
            scene.set("boundary%velocity_y", 1)
        with self.assertRaisesRegex(KeyError, "no &crack"):
            scene.set("crack%from", [0, 0])
        with self.assertRaisesRegex(KeyError, "expected group%key"):
            scene.set("ratio", 3)

    def test_groups(self):
        scene = self.scene("&time steps = 3 / &boundary name = 'a' / &boundary name = 'b' /")
        self.assertEqual([group.name for group in scene], ["time", "boundary", "boundary"])
        with self.assertRaisesRegex(KeyError, "no &boundary is called 'c'.*a, b"):
            scene["boundary", "c"]
        with self.assertRaisesRegex(KeyError, "ask for one"):
            scene["boundary"]
        with self.assertRaisesRegex(SceneError, "at most once"):
            scene.add("time")
        twin = scene.copy()
        twin["time"]["steps"] = 4
        twin.remove(twin["boundary", "a"])
        self.assertEqual((scene["time"]["steps"], len(scene)), (3, 3))
        scene["time"]["steps"] = None
        self.assertNotIn("steps", scene["time"])


if __name__ == "__main__":
    unittest.main()
