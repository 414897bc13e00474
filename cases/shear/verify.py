"""Stiffness in shear, torsion and bending for each volume correction: exact moduli of the infinite
lattice, bars and strips under small loads. --quick leaves out the bars of 24 points across."""
import sys
from pathlib import Path

import numpy as np
from common import Case

sys.path.insert(0, str(Path(__file__).resolve().parent))
from moduli import RULES, Moduli, table  # noqa: E402

MODULUS, RATIO, WIDTH, LENGTH = 200e9, 3.015, 1.0, 4.0
# Small enough that the square of the strain is below every tolerance here
FORCE = 1e4  # [N/m3] at the edge of the end row
# Torsion constant of a square bar over the fourth power of its side, by Saint-Venant's series
SERIES = 1 / 3 - 64 / np.pi**5 * sum(np.tanh((2 * k + 1) * np.pi / 2) / (2 * k + 1)**5 for k in range(50))
POISSON = 0.3


def horizon(rule, surface, ratio=RATIO):
    """The group &horizon."""
    return (f"&horizon\n  ratio = {ratio}\n  volume_correction = '{rule}'\n"
            f"  surface_correction = '{'energy' if surface else 'none'}'\n/\n")


def head(dim, lower, upper, points):
    """Scene, body and material."""
    return (f"&scene\n  dimension = {dim}\n/\n&body\n  lower = {numbers(lower)}\n  upper = {numbers(upper)}\n"
            f"  points = {numbers(points)}\n/\n&material\n  youngs_modulus = {MODULUS}\n"
            f"  poissons_ratio = {POISSON}\n  density = 7850.0\n/\n")


def numbers(values):
    """A list as a scene has it."""
    return ", ".join(f"{value:.15g}" for value in values)


def sheared(case, dim, rule, surface, angle):
    """Energy density of a point deep inside a lattice under simple shear along an axis (angle 0) or
    pure shear at 45 degrees, over the classical one.
    """
    n, strain = 13, 1e-6
    scene = head(dim, [-0.5 * n] * dim, [0.5 * n] * dim, [n] * dim) + horizon(rule, surface)
    if angle == 0:
        scene += f"&initial\n  displacement_gradient(1,2) = {strain}\n/\n"
        classical = strain**2 / 2
    else:
        scene += (f"&initial\n  displacement_gradient(1,1) = {strain}\n"
                  f"  displacement_gradient(2,2) = {-strain}\n/\n")
        classical = 2 * strain**2
    scene += "&time\n  steps = 1\n/\n&output\n  fields = 'energy_density'\n/\n"
    name = f"sheared_{dim}d_{rule}_{on(surface)}_{angle}.nml"
    results = case.run(name, scene, threads=1)
    shear = MODULUS / (2 * (1 + POISSON))
    centre = results.nearest([0.0] * dim)
    return results.field("energy_density", 0)[centre] / (shear * classical)


def rows(n):
    """Centres of n cells across the width."""
    return (np.arange(n) + 0.5) / n * WIDTH - WIDTH / 2


def row_load(name, lower, upper, component, density):
    """A region and the force density [N/m3] on it."""
    return (f"&region\n  name = '{name}'\n  shape = 'box'\n  lower = {numbers(lower)}\n"
            f"  upper = {numbers(upper)}\n/\n"
            f"&load\n  region = '{name}'\n  body_force_{component} = {density:.15g}\n/\n")


RELAXATION = ("&time\n  method = 'relaxation'\n/\n&relaxation\n  tolerance = 1.0e-8\n/\n"
              "&output\n  fields = 'displacement'\n/\n")


def torsion(case, n, rule, surface, ratio=RATIO):
    """Torsional stiffness of a free square bar over the classical one.

    Both end rows are turned by force densities (0, -z, y); the ends' influence decays within about a width
    (Saint-Venant), and the twist is that of the middle half of the bar.
    """
    dx, half = WIDTH / n, LENGTH / 2
    scene = head(3, [-half, -WIDTH / 2, -WIDTH / 2], [half, WIDTH / 2, WIDTH / 2],
                 [round(LENGTH / dx), n, n]) + horizon(rule, surface, ratio)
    for sign, low, high in ((1, half - dx, half), (-1, -half, -half + dx)):
        end = "right" if sign > 0 else "left"
        for i, centre in enumerate(rows(n)):
            low_side, high_side = centre - dx / 2, centre + dx / 2
            scene += row_load(f"{end}_z{i}", [low, -1, low_side], [high, 1, high_side], "y",
                              -sign * FORCE * centre)
            scene += row_load(f"{end}_y{i}", [low, low_side, -1], [high, high_side, 1], "z",
                              sign * FORCE * centre)
    results = case.run(f"torsion_{n}_{ratio}_{rule}_{on(surface)}.nml", scene + RELAXATION, threads=1)
    x, u = results.points, results.field("displacement")
    last = x[:, 0] > half - dx
    torque = FORCE * np.sum((x[last, 1]**2 + x[last, 2]**2) * results.volume[last])
    places, turned = sections(x, x[:, 1] * u[:, 2] - x[:, 2] * u[:, 1], x[:, 1]**2 + x[:, 2]**2)
    twist = slope(places, turned, 0.5 * half)
    shear = MODULUS / (2 * (1 + POISSON))
    return torque / (shear * SERIES * WIDTH**4 * twist)


def sections(x, moment, square):
    """Positions of the cross sections and sum(moment)/sum(square) in each."""
    places, which = np.unique(np.round(x[:, 0], 9), return_inverse=True)
    return places, np.bincount(which, moment) / np.bincount(which, square)


def slope(places, values, reach):
    """The slope at 0 of a parabola through the values within `reach` of 0."""
    near = np.abs(places) < reach
    return np.polyfit(places[near], values[near], 2)[1]


def cantilever(case, dim, n, rule, surface, ratio=RATIO):
    """Bending stiffness of a cantilever in the middle of its length over the classical one, and its shear
    stiffness over that by Cowper's coefficient.

    The side x_min is held, the end row is pushed across. The moment at the middle is that of the force about
    it; the rotation of a section is that of the plane nearest to its displacements, whose rate is M/(E I) by
    Saint-Venant's solution, and the mean deflection's slope and it differ by F/(k G A).
    """
    dx, half = WIDTH / n, LENGTH / 2
    across = dim - 1
    scene = head(dim, [-half] + [-WIDTH / 2] * across, [half] + [WIDTH / 2] * across,
                 [round(LENGTH / dx)] + [n] * across) + horizon(rule, surface, ratio)
    scene += "&boundary\n  side = 'x_min'\n" + "".join(f"  displacement_{c} = 0.0\n" for c in "xyz"[:dim]) + "/\n"
    scene += row_load("end", [half - dx] + [-1] * across, [half] + [1] * across, "y", FORCE)
    results = case.run(f"cantilever_{dim}d_{n}_{ratio}_{rule}_{on(surface)}.nml", scene + RELAXATION, threads=1)
    body = results.layer == 0
    x, u, volume = results.points[body], results.field("displacement")[body], results.volume[body]
    last = x[:, 0] > half - dx
    force = FORCE * volume[last].sum()
    moment = force * (half - dx / 2)
    places, turned = sections(x, -x[:, 1] * u[:, 0], x[:, 1]**2)
    _, deflection = sections(x, u[:, 1], np.ones(len(x)))
    inertia, area = WIDTH**4 / 12 if dim == 3 else WIDTH**3 / 12, WIDTH**(dim - 1)
    bending = moment / (MODULUS * inertia * slope(places, turned, 0.5 * half))
    nu = POISSON
    # of the parabola's value at 0; the rotation itself, not its rate
    near = np.abs(places) < 0.5 * half
    angle = np.polyfit(places[near], deflection[near], 3)[2] - np.polyfit(places[near], turned[near], 2)[2]
    coefficient = 10 * (1 + nu) / (12 + 11 * nu)
    shear = force / (coefficient * MODULUS / (2 * (1 + nu)) * area * angle)
    return bending, shear


def judge_sums(case):
    """The program's energy density inside a sheared lattice must be that of the lattice sums.

    They are exact for small strains; what is left is the strain's square, 1e-12, rounding, and the quadrature
    of `exact` on both sides.
    """
    for dim in (2, 3):
        for rule in RULES:
            for surface in (True, False):
                moduli = Moduli(dim, RATIO, rule, POISSON, surface)
                for angle, modulus in ((0, moduli.axial), (45, moduli.diagonal)):
                    case.near(f"{dim}D, {rule}, surface correction {on(surface)}: shear at {angle} degrees over mu",
                              sheared(case, dim, rule, surface, angle), modulus, relative=1e-8)


def judge_bars(case, n):
    """Torsion and bending in space.

    A thick bar twists by the shear modulus of its lattice. What a bar of n points across adds is the error of
    its surfaces, some part of horizon over width: with surface correction less than half of it.
    """
    surfaces = 0.5 * RATIO / n
    for rule in RULES:
        lattice = Moduli(3, RATIO, rule, POISSON)
        twisted, bent = torsion(case, n, rule, True), cantilever(case, 3, n, rule, True)
        case.near(f"torsion, {n} points across, {rule}, over classical", twisted, lattice.axial, relative=surfaces)
        case.near(f"bending, {n} points across, {rule}, over classical", bent[0], lattice.young, relative=surfaces)
        case.show("   shear of the bent bar", bent[1], lattice.axial)
        case.show("   torsion without surface correction", torsion(case, n, rule, False),
                  Moduli(3, RATIO, rule, POISSON, False).axial)
        case.show("   bending without surface correction", cantilever(case, 3, n, rule, False)[0],
                  Moduli(3, RATIO, rule, POISSON, False).young)


def judge_strips(case, n):
    """Bending and shear in the plane, on strips of n points across; tolerances as for the bars."""
    surfaces = 0.5 * RATIO / n
    for rule in RULES:
        lattice = Moduli(2, RATIO, rule, POISSON)
        bent = cantilever(case, 2, n, rule, True)
        case.near(f"strip, {n} points across, {rule}: bending over classical", bent[0], lattice.young,
                  relative=surfaces)
        case.near("   shear of the bent strip over classical", bent[1], lattice.axial, relative=surfaces)
        free = cantilever(case, 2, n, rule, False)
        case.show("   bending without surface correction", free[0], Moduli(2, RATIO, rule, POISSON, False).young)
        case.show("   shear without surface correction", free[1], Moduli(2, RATIO, rule, POISSON, False).axial)


def judge_ratios(case, n):
    """Other horizons in space, with surface correction."""
    for ratio in (2.015, 4.015):
        for rule in RULES:
            lattice = Moduli(3, ratio, rule, POISSON)
            case.near(f"torsion, horizon {ratio} dx, {n} points across, {rule}", torsion(case, n, rule, True, ratio),
                      lattice.axial, relative=0.5 * ratio / n)
            case.near(f"bending, horizon {ratio} dx, {n} points across, {rule}",
                      cantilever(case, 3, n, rule, True, ratio)[0], lattice.young, relative=0.5 * ratio / n)


def on(surface):
    """The word of a switch."""
    return "on" if surface else "off"


def main():
    case = Case(__file__, __doc__)
    case.out.mkdir(parents=True, exist_ok=True)
    for dim, nu in ((3, POISSON), (2, POISSON)):
        print(f"\nMean moduli of an infinite lattice, {dim}D, nu = {nu:g}, over the classical ones")
        print("\n".join(table(dim, nu, (2.015, 3.015, 4.015, 5.015, 6.015))) + "\n", flush=True)
    judge_sums(case)
    judge_bars(case, 12)
    judge_strips(case, 24)
    if not case.options.quick:
        judge_bars(case, 24)
        judge_strips(case, 96)
        judge_ratios(case, 24)
    case.finish()


main()
