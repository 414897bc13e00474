"""Lattices that are finer in places beside ones that are fine everywhere: the stress at a hole, a crack
that grows, a crack that runs through a change of spacing, a pulse that comes to finer points. --quick leaves out
the plate with the hole and the strip.
"""
import re

import numpy as np
from common import Case, change

RADIUS, PULL = 0.005, 1.0e6


def plain(scene, points):
    """The scene with one spacing."""
    scene = re.sub(r"^&refine\b.*?^/\n", "", scene, flags=re.M | re.S)
    return change(scene, "body", points=f"{points}, {points}")


def ahead(results):
    """Mean of the stress of the first 16 points beside the hole on the line across the load, over that
    of the plate.
    """
    x, stress = results.points, results.field("stress_yy") / PULL
    row = np.flatnonzero((np.abs(x[:, 1]) < 4e-5) & (x[:, 0] > 0))
    first = row[np.argsort(x[row, 0])][:32]
    return stress[first].mean()


def hole(case):
    """The stress at the hole: at the worst point, and of 1 mm beside it."""
    scene = case.scene("plate_hole.nml")
    refined = case.run("plate_hole.nml", threads=1)
    fine = case.run("fine_hole.nml", plain(scene, 800), threads=1)
    case.near("hole: largest stress over the load, 54,500 points [-]",
              refined.field("stress_yy").max() / PULL, fine.field("stress_yy").max() / PULL, relative=0.01)
    case.near("hole: stress over 1 mm beside it over the load [-]", ahead(refined), ahead(fine),
              relative=0.01)
    times(case, "hole", "plate_hole", "fine_hole", 0.2)
    return refined


def crack(case):
    """The tip of the crack and the energy it took."""
    scene = case.scene("plate_crack.nml")
    refined = case.run("plate_crack.nml", threads=1)
    fine = case.run("fine_crack.nml", plain(scene, 500), threads=1)
    # a step is as long as four of the others, and a little shorter so that both end at the same time
    text = change(scene, "time", step=1250 * 1.33666e-8 / 313, steps=313, substeps=".true.")
    short = case.run("substeps_crack.nml", change(text, "output", every=313, history_every=62), threads=1)
    spacing = 0.4e-3
    case.near("crack, substeps: x of the tip [m]", short.history["tip_x"][-1], fine.history["tip_x"][-1],
              absolute=spacing)
    case.near("crack, substeps: dissipated energy [J]", short.history["dissipated_energy"][-1],
              fine.history["dissipated_energy"][-1], relative=0.05)
    times(case, "crack, substeps", "substeps_crack", "fine_crack", 0.2)
    if {"plate_crack", "substeps_crack"} <= case.run_times.keys():
        case.below("crack: time with substeps over that without, 1 thread [-]",
                   case.run_times["substeps_crack"] / case.run_times["plate_crack"], 0.95)
    case.near("crack: x of the tip [m]", refined.history["tip_x"][-1], fine.history["tip_x"][-1],
              absolute=spacing)
    case.near("crack: y of the tip [m]", refined.history["tip_y"][-1], fine.history["tip_y"][-1],
              absolute=spacing)
    case.near("crack: dissipated energy [J]", refined.history["dissipated_energy"][-1],
              fine.history["dissipated_energy"][-1], relative=0.05)
    times(case, "crack", "plate_crack", "fine_crack", 0.2,
          "0.19 to 0.20 where it was measured, too near to the target to be judged on every machine")
    return refined


def times(case, what, refined, fine, target, reason=""):
    """The ratio of the times of two runs, if both were made now; with a reason the target is known to be missed."""
    if refined not in case.run_times or fine not in case.run_times:
        return
    ratio = case.run_times[refined] / case.run_times[fine]
    name = f"{what}: time over that of fine points everywhere, 1 thread [-]"
    if reason:
        case.not_met(name, ratio, target, ratio <= target, reason)
    else:
        case.below(name, ratio, target)


def strip(case):
    """What a crack costs that runs through a change of spacing, over the same 46 mm."""
    scene = case.scene("strip.nml")
    turned = scene.replace("lower(1) = 0.02", "upper(1) = 0.02")
    one = re.sub(r"^&refine\b.*?^/\n", "", scene, flags=re.M | re.S)
    costs = []
    for name, text in (("strip_coarse", one), ("strip", scene), ("strip_turned", turned)):
        history = case.run(name + ".nml", text, threads=1).history
        tip, lost = np.asarray(history["tip_x"]), np.asarray(history["dissipated_energy"])
        inside = np.flatnonzero((tip > 4e-3) & (tip < 50e-3))
        first, last = inside[0], inside[-1]
        # the scene has no thickness, so that an area is a length
        costs.append((lost[last] - lost[first]) / (tip[last] - tip[first]) / 3.0)
    case.show("strip of one spacing: dissipated energy per area over Gc [-]", costs[0], 1.0)
    case.near("strip, coarse to fine: the same over that of one spacing [-]", costs[1] / costs[0], 1.0, relative=0.05)
    case.near("strip, fine to coarse: the same over that of one spacing [-]", costs[2] / costs[0], 1.0, relative=0.05)


def pulse(case, dim, levels):
    """A pulse of 20 coarse spacings that comes to finer points: what comes back, the difference to a
    body of one spacing, over the pulse.
    """
    n = 400 if dim == 1 else 200
    width, start = 20 / n, 0.2
    speed = 1.0 if dim == 1 else 1 / np.sqrt(1 - 0.25**2)
    inside = f"(abs(x - {start}) < {width / 2})*1e-5*0.5"
    k = 2 * np.pi / width
    upper, points = ("1", f"{n}") if dim == 1 else (f"1, {40 / n}", f"{n}, 40")
    scene = (f"&scene\n  dimension = {dim}\n  thickness = 1.0\n  area = 1.0\n/\n"
             f"&body\n  lower = {dim}*0\n  upper = {upper}\n  points = {points}\n/\n"
             "&material\n  youngs_modulus = 1.0\n  poissons_ratio = 0.25\n  density = 1.0\n/\n"
             f"&refine\n  shape = 'box'\n  lower(1) = 0.5\n  levels = {levels}\n/\n"
             f"&initial\n  displacement_x = '{inside}*(1 + cos({k:.15g}*(x - {start})))'\n"
             f"  velocity_x = '{inside}*{k * speed:.15g}*sin({k:.15g}*(x - {start}))'\n/\n"
             f"&time\n  duration = {0.5 / speed:.15g}\n  safety = 0.5\n/\n"
             "&output\n  fields = 'displacement'\n/\n")
    if dim == 2:
        scene += ("&region\n  name = 'all'\n  shape = 'box'\n  lower(1) = -1\n/\n"
                  "&boundary\n  region = 'all'\n  displacement_y = 0\n/\n")
    one = re.sub(r"^&refine\b.*?^/\n", "", scene, flags=re.M | re.S)
    parts = []
    for name, text in ((f"pulse_{dim}d_{levels}", scene), (f"pulse_{dim}d", one)):
        results = case.run(name + ".nml", text, threads=1)
        x, u = results.points, results.field("displacement")[:, 0]
        # away from the sides of the plate, on which the pulse runs slower
        middle = np.abs(x[:, 1] - (20 / n if dim == 2 else 0)) < 8 / n
        before = np.flatnonzero(middle & (x[:, 0] < 0.45))
        order = before[np.lexsort((x[before, 0].round(9), x[before, 1].round(9)))]
        parts.append((u[order], np.abs(u[middle]).max()))
    back = np.abs(parts[0][0] - parts[1][0]).max() / parts[1][1]
    case.below(f"pulse in {dim}D, levels = {levels}: reflected part of the displacement [-]", back, 0.03)


def main():
    case = Case(__file__, __doc__)
    for dim in (1, 2):
        for levels in (1, 2):
            pulse(case, dim, levels)
    cracked = crack(case)
    if not case.options.quick:
        strip(case)
        pulled = hole(case)
        if case.options.pictures:
            picture(case, pulled, cracked)
    case.finish()


def picture(case, hole, crack):
    """The stress at the hole, and the cracked plate, in cells of their size."""
    from perifort.pictures.layout import new_figure
    from plot import draw, save
    figure = new_figure(9.0, 4.0)
    draw(figure, (1, 2, 1), hole, "stress_yy", -1, "1 MPa along y", 0, window=((0, 0.011), (-0.0055, 0.0055)))
    draw(figure, (1, 2, 2), crack, "damage", -1, "edges pulled apart at 20 m/s", 0,
         window=((0.013, 0.0245), (-0.005, 0.005)))
    save(figure, case.folder / "refined.png")


if __name__ == "__main__":
    main()
