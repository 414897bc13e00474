"""Bodies under uniform stress, bent, twisted, and a hole: what each surface correction leaves of the
classical answer."""
import re
import sys
from pathlib import Path

import numpy as np
from common import Case, change

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fracture"))
import waves  # noqa: E402

CORRECTIONS = ("consistent", "energy", "none")
YOUNG, NU, PULL = 2e11, 0.3, 10.0
HOWLAND = 3.14


def with_correction(text, correction):
    """The scene with a surface correction."""
    if "&horizon" in text:
        return change(text, "horizon", surface_correction=f"'{correction}'")
    return text + f"&horizon\n  surface_correction = '{correction}'\n/\n"


def unevenness(results, known):
    """The largest difference from a uniform stress, over its largest component."""
    return max(float(np.abs(np.asarray(results.field(f"stress_{name}")) - value).max())
               for name, value in known.items()) / max(abs(value) for value in known.values())


def elongation(results):
    """Strain along x of the outermost columns, over s/E."""
    x, u = results.points[:, 0], np.asarray(results.field("displacement"))[:, 0]
    ends = x > x.max() - 1e-9, x < x.min() + 1e-9
    return float((u[ends[0]].mean() - u[ends[1]].mean()) / (x.max() - x.min()) * YOUNG / PULL)


def narrowing(results):
    """Strain along y of the outermost rows at mid-length, over -nu s/E."""
    x, u = results.points, np.asarray(results.field("displacement"))
    middle = np.abs(x[:, 0] - x[:, 0].mean()) < 0.3 * np.ptp(x[:, 0])
    low, high = x[:, 1].min(), x[:, 1].max()
    upper, lower = middle & (x[:, 1] > high - 1e-9), middle & (x[:, 1] < low + 1e-9)
    return float((u[upper, 1].mean() - u[lower, 1].mean()) / (high - low) / (-NU * PULL / YOUNG))


def tension(case, scene, factor):
    """The body of a scene, so many times finer, with its tractions along x alone."""
    text = case.scene(scene)
    loads = text.index("! Tractions"), text.index("&time")
    area = 36.0 if "dimension = 3" in text else 1.0
    text = text[:loads[0]] + "".join(
        f"&load\n  side = '{side}'\n  force_x = {sign * PULL * area}\n/\n\n"
        for side, sign in (("x_max", 1), ("x_min", -1))) + text[loads[1]:]
    numbers = [factor * int(n) for n in text.split("points = ")[1].split("\n")[0].split(",")]
    return change(text, "body", points=", ".join(map(str, numbers)))


def bending(case, across, correction):
    """Curvature in the middle of the strip over the classical one."""
    text, dx = case.scene("bending.nml"), 1.0 / across
    new = {"1.9": f"{2 - dx:.10g}", "1.8": f"{2 - 2 * dx:.10g}",
           "15*y": f"{1.5 * across:.10g}*y", "5*y": f"{0.5 * across:.10g}*y"}
    text = re.sub(r"1\.[89]\b|15\*y|5\*y", lambda found: new[found.group(0)], text)
    text = change(text, "body", points=f"{4 * across}, {across}")
    results = case.run(f"bending_{across}_{correction}.nml", with_correction(text, correction),
                       threads=1)
    x, u = results.points, np.asarray(results.field("displacement"))
    middle = (np.abs(x[:, 0]) < 1.0) & (np.abs(x[:, 1]) < dx)
    return -2 * np.polyfit(x[middle, 0], u[middle, 1], 2)[0] * YOUNG


def hole(case, correction):
    """The stress concentration at the rim of the plate of the case plate_hole, by the field `stress`.

    Its values beyond a horizon from the rim are continued to it by the terms of the classical
    solution: 1, (a/r)^2, (a/r)^4.
    """
    radius, side, points, thickness = 0.005, 0.05, 100, 5e-4
    spacing = side / points
    path = Path(__file__).resolve().parents[1] / "plate_hole" / "elastic.nml"
    text = path.read_text(encoding="utf-8").replace("2.7541e-4", "2.7541e-10")
    text = change(text, "body", points=f"{points}, {points}")
    text = change(text, "material", model="'state_based'")
    text = change(text, "output", fields="'displacement', 'stress'")
    results = case.run(f"hole_{correction}.nml", with_correction(text, correction))
    x = results.points
    near = (np.abs(np.abs(x[:, 1]) - spacing / 2) < 1e-9) & (x[:, 0] - radius > 3 * spacing) \
        & (x[:, 0] < 0.45 * side)
    mean = results.history["top_reaction_y"][-1] / (side * thickness)
    stress = np.asarray(results.field("stress_yy"))[near] / mean
    return float(np.polyval(np.polyfit((radius / x[near, 0])**2, stress, 2), 1.0))


def main():
    case = Case(__file__, __doc__)
    case.threads = 0
    plate = case.run("plate.nml", threads=1)
    case.below("plate of 30 x 10 points, three stresses at once: largest error of a stress",
               unevenness(plate, dict(xx=10.0, yy=-3.0, xy=5.0)), 1e-9)
    block = case.run("block.nml", threads=1)
    case.below("block of 10 x 6 x 6 points, tension and shear: largest error of a stress",
               unevenness(block, dict(xx=10.0, yy=0.0, xy=5.0)), 1e-9)
    for what, scene, factor in (("plate, 10 points wide", "plate.nml", 1),
                                ("plate, 20 points wide", "plate.nml", 2),
                                ("block of 10 x 6 x 6 points", "block.nml", 1)):
        for correction in CORRECTIONS:
            results = case.run(f"tension_{scene[:-4]}_{factor}_{correction}.nml",
                               with_correction(tension(case, scene, factor), correction), threads=1)
            judge = case.near if correction == "consistent" else (
                lambda text, value, target, absolute: case.show(text, value, target))
            judge(f"{what} in tension, '{correction}': elongation over the classical one",
                  elongation(results), 1.0, absolute=1e-9)
            judge("   narrowing", narrowing(results), 1.0, absolute=1e-9)
    numbers, bent = (5, 10, 20, 40), {}
    for correction in CORRECTIONS:
        values = np.array([bending(case, n, correction) for n in numbers])
        errors = bent[correction] = np.abs(values - 1)
        for n, value in zip(numbers, values):
            case.show(f"strip of {n} points across, '{correction}': curvature over the classical one",
                      value, 1.0)
        orders = np.log2(errors[:-1] / errors[1:])
        if correction == "consistent":
            case.near("   observed order from 5 to 40 points", float(orders.mean()), 2.0, absolute=0.25)
            case.below("   error with 20 points", float(errors[2]), 0.01)
        else:
            case.show("   observed order from 5 to 40 points", float(orders.mean()))
    for correction in CORRECTIONS:
        value, text = hole(case, correction), f"plate with a hole, '{correction}': concentration of stress"
        if correction == "consistent":
            case.near(text, value, HOWLAND, relative=0.02)
        else:
            case.show(text, value, HOWLAND)
    if not case.options.quick:
        for correction in CORRECTIONS:
            value = 1 + twist(case, correction)
            text = f"bar 10 points thick, '{correction}': frequency of torsion over the closed form"
            if correction == "consistent":
                case.near(text, value, 1.0, relative=0.02)
            else:
                case.show(text, value, 1.0)
    if case.options.pictures:
        picture(case, numbers, bent)
    case.finish()


def picture(case, numbers, bent):
    """Errors of the curvature against the points across."""
    from perifort.pictures.layout import new_figure
    from plot import save
    figure = new_figure(5.0, 3.4)
    axes = figure.subplots()
    for correction, errors in bent.items():
        axes.loglog(numbers, errors, "o-", label=f"'{correction}'")
    axes.loglog(numbers, 0.2 * (numbers[0] / np.array(numbers))**2, "--", color="0.5",
                label="second order")
    axes.set(xlabel="points across", ylabel="error of the curvature")
    axes.legend()
    save(figure, case.folder / "bending.png")


def twist(case, correction):
    """Error of the torsion frequency of the bar of the case fracture."""

    class Bar:
        """The case with the bar's scene under a correction."""
        threads = 0

        @staticmethod
        def scene(name):
            path = Path(__file__).resolve().parents[1] / "fracture" / name
            return path.read_text(encoding="utf-8")

        @staticmethod
        def run(name, text, threads=0):
            text = change(text, "horizon", surface_correction=f"'{correction}'")
            return case.run(f"{correction}_{name}", text, threads=threads)

    return waves.torsion_bar(Bar, 10)


main()
