"""A tube of steel that flies apart: energy at the start beside the integral, momentum and energy kept, mirror symmetry,
and how the mass is distributed over fragments. --quick: points of 2.5 mm.
"""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from common import Case  # noqa: E402

DENSITY, YOUNG, NU, STRETCH, RATIO = 7800.0, 195e9, 0.25, 0.02, 3.015
INNER, OUTER, LENGTH = 20e-3, 25e-3, 100e-3
MIDDLE = np.array([0.0, 0.0, LENGTH / 2])
# With s = z/0.05 - 1 uniform from -1 to 1: the means of (200 - 50 s^2)^2 and of (100 s)^2
ENERGY = (200.0**2 - 200 * 50 * 2 / 3 + 50.0**2 / 5 + 100.0**2 / 3) / 2


def fragments(results):
    """The table of fragments of every output."""
    return np.genfromtxt(results.folder / "fragments.csv", delimiter=",", names=True)


def momenta(results, output):
    """Momentum of all and angular momentum about the middle."""
    mass = (DENSITY * results.volume)[:, None]
    y, v = results.points - MIDDLE + results.field("displacement", output), results.field("velocity", output)
    return np.sum(mass * v, axis=0), np.sum(mass * np.cross(y, v), axis=0)


def unlike(results, spacing):
    """The part of the points whose damage is not that of their images in the planes x = 0, y = 0 and z = 50 mm, which
    are planes of symmetry of lattice and motion.
    """
    place = np.round((results.points - MIDDLE) / spacing * 2).astype(int)
    number = {tuple(p): i for i, p in enumerate(place)}
    damage, worst = np.asarray(results.field("damage")), 0.0
    for axis in range(3):
        sign = np.ones(3, dtype=int)
        sign[axis] = -1
        image = np.array([number[tuple(p)] for p in place * sign])
        worst = max(worst, float(np.mean(np.abs(damage - damage[image]) > 1e-6)))
    return worst


def grady(spacing):
    """Grady's size of fragments (24 G/(rho rate^2))^(1/3), with the toughness of the critical stretch (Silling and
    Askari 2005) and the rate at which the middle of the tube grows [m].
    """
    bulk = YOUNG / (3 * (1 - 2 * NU))
    toughness = 9 * bulk * RATIO * spacing * STRETCH**2 / 5
    rate = 200.0 / ((INNER + OUTER) / 2)
    return (24 * toughness / (DENSITY * rate**2))**(1 / 3)


def main():
    case = Case(__file__, __doc__)
    text, spacing = case.scene("cylinder.nml"), 1.25e-3
    if case.options.quick:
        text, spacing = text.replace("spacing = 1.25e-3", "spacing = 2.5e-3"), 2.5e-3
    results = case.run("cylinder.nml", text)
    h, table = results.history, fragments(results)

    mass = DENSITY * results.volume.sum()
    tube = DENSITY * np.pi * (OUTER**2 - INNER**2) * LENGTH
    if case.options.quick:
        case.show("mass [kg], that of the tube", mass, tube)
    else:
        case.near("mass [kg], that of the tube", mass, tube, relative=0.03)
    case.near("kinetic energy at the start over the mass [J/kg]", h["kinetic_energy"][0] / mass, ENERGY, relative=0.005)
    # Momentum is measured by that of a body of this mass that moves with 200 m/s
    found = [momenta(results, k) for k in range(results.outputs)]
    case.below("momentum over mass and 200 m/s, largest of all outputs", max(np.abs(p).max() for p, _ in found)
               / (mass * 200), 1e-11)
    case.below("   angular momentum, over that at the rim", max(np.abs(a).max() for _, a in found)
               / (mass * 200 * OUTER), 1e-11)
    case.below("   largest gap of the energy balance [-]", results.balance(), 0.01)
    case.below("   points whose damage is not that of a mirror image [part]", unlike(results, spacing), 0.05)

    last = table[table["output"] == table["output"].max()]
    case.near("fragments: sum of their masses [kg]", last["mass"].sum(), mass, relative=1e-12)
    carried = np.array([np.sum(last["mass"] * last[f"velocity_{c}"]) for c in "xyz"])
    case.below("   sum of their momenta over mass and 200 m/s", np.abs(carried).max() / (mass * 200), 1e-11)
    # A piece is as large as the wall is thick
    pieces = last[last["mass"] > DENSITY * (OUTER - INNER)**3]
    case.above("   pieces heavier than a cube of the wall's thickness", len(pieces), 1)
    case.show("   all fragments, points alone among them", f"{len(last)}, {np.sum(last['points'] == 1)}")
    share = pieces["mass"].sum() / mass
    case.above("   mass in these pieces [part]", share, 0.5)
    case.show("   largest one over all mass", last["mass"].max() / mass)
    along = np.sort(pieces["mass"])[::-1]
    half = int(np.searchsorted(np.cumsum(along), mass / 2)) + 1
    case.show("   so many of the largest have half of the mass", half)
    # As squares of the tube's wall
    size = np.sqrt(np.average(pieces["mass"], weights=pieces["mass"]) / (DENSITY * (OUTER - INNER)))
    what = "   size of a piece, mean by mass [m], beside Grady's"
    if case.options.quick:
        case.show(what, size, grady(spacing))
    else:
        case.near(what, size, grady(spacing), relative=0.5)
    outward = np.sum(pieces["centre_x"] * pieces["velocity_x"] + pieces["centre_y"] * pieces["velocity_y"]) \
        / np.sum(np.hypot(pieces["centre_x"], pieces["centre_y"]))
    case.show("   their mean speed outwards [m/s]", outward)
    if case.options.pictures:
        pictures(case, results, last)
    case.finish()


def pictures(case, results, last):
    """The tube at three times, the distribution of masses at the end, and a film."""
    from perifort.pictures.layout import new_figure
    from plot import draw, save, small_film
    figure = new_figure(10.0, 7.0)
    for place, output in enumerate((4, 10, results.outputs - 1), start=1):
        draw(figure, (2, 2, place), results, "damage", output, f"{1e6 * results.times[output]:.0f} us", 1.0)
    axes = figure.add_subplot(2, 2, 4)
    order = np.sort(last["mass"])[::-1]
    axes.loglog(1e3 * order, np.arange(1, len(order) + 1), drawstyle="steps-post")
    axes.set(xlabel="mass [g]", ylabel="fragments at least as heavy", title="at the end")
    axes.grid(alpha=0.3)
    save(figure, case.folder / "fragments.png", dpi=68)
    small_film(results, "damage", case.folder / "film.gif", width=560, colours=24, every=2)


main()
