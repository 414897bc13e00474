"""A square plate with a circular hole, pulled apart: its stress concentration, and how it
breaks.
"""
import numpy as np
from common import Case, change
from discrete import Lattice

MODULUS, RATIO, SIDE, RADIUS, THICKNESS, PULL = 192e9, 3.015, 0.05, 0.005, 5e-4, 2.7541e-4
# Infinite plate: Kirsch. Strip whose width is five diameters, over the stress of the whole section:
# Howland
KIRSCH, HOWLAND = 3.0, 3.14


def ligament(results, spacing):
    """Positions x > 0 on the line across the plate through the hole, and E times the strain along
    the load there over the mean stress of the whole section."""
    x, u = results.points, results.field("displacement")
    upper = np.flatnonzero((np.abs(x[:, 1] - spacing / 2) < 1e-9) & (x[:, 0] > 0))
    lower = np.flatnonzero((np.abs(x[:, 1] + spacing / 2) < 1e-9) & (x[:, 0] > 0))
    strain = (u[upper, 1] - u[lower, 1]) / spacing
    mean = results.history["top_reaction_y"][-1] / (SIDE * THICKNESS)
    return x[upper, 0], MODULUS * strain / mean


def concentration(results, spacing):
    """The stress concentration: the stress at the hole's side is uniaxial, so it is E times the
    strain there.

    The points within a horizon of the hole are softer than the rest, so the strain at the rim is
    found from those beyond, by the terms of the classical solution: 1, (a/r)^2, (a/r)^4.
    """
    x, stress = ligament(results, spacing)
    used = (x - RADIUS > 3 * spacing) & (x - RADIUS < 20.5 * spacing)
    return np.polyval(np.polyfit((RADIUS / x[used])**2, stress[used], 2), 1.0), stress.max()


def concentration_of_stress(results, spacing):
    """The same from the field `stress`, on both sides of the line."""
    x = results.points
    near = (np.abs(np.abs(x[:, 1]) - spacing / 2) < 1e-9) & (x[:, 0] - RADIUS > 3 * spacing) \
        & (x[:, 0] - RADIUS < 20.5 * spacing)
    mean = results.history["top_reaction_y"][-1] / (SIDE * THICKNESS)
    stress = results.field("stress_yy")[near] / mean
    return np.polyval(np.polyfit((RADIUS / x[near, 0])**2, stress, 2), 1.0)


def linear_variant(case, points, tolerance):
    """The elastic plate pulled a million times less far, where its answer is linear."""
    scene = case.scene("elastic.nml").replace("2.7541e-4", "2.7541e-10")
    scene = change(scene, "output", fields="'displacement', 'stress'")
    return change(change(scene, "body", points=f"{points}, {points}"), "relaxation",
                  tolerance=tolerance)


def from_discrete(results, spacing):
    """Largest distance from the solution of the linear discrete equations, over the largest
    displacement.
    """
    points = results.points[:, :2]
    lattice = Lattice(points, spacing, RATIO * spacing, MODULUS, 1 / 3, THICKNESS)
    held = np.zeros(points.shape, bool)
    held[:, 1] = results.layer > 0
    imposed = np.sign(points) * PULL / 1e6
    u = results.field("displacement")[:, :2]
    # Nothing holds the plate along x
    u = u - [u[:, 0].mean(), 0.0]
    held[results.nearest([0.02475, 0.02475]), 0] = True
    discrete = lattice.statics(np.zeros(points.shape), held,
                               np.where(held & (results.layer == 0)[:, None], 0, imposed))
    discrete = discrete - [discrete[:, 0].mean(), 0.0]
    return np.abs(u - discrete).max() / np.abs(discrete).max()


def main():
    case = Case(__file__, __doc__)
    spacing = SIDE / 100

    elastic = case.run("elastic.nml", threads=1)
    small = case.run("small_pull.nml", linear_variant(case, 100, 1e-10), threads=1)
    case.below("small pull: distance from the discrete solution [-]", from_discrete(small, spacing),
               1e-6)
    for points, allowed in ((100, 0.1), (200, 0.05)):
        if points == 100:
            results = small
        else:
            results = case.run("small_pull_fine.nml", linear_variant(case, points, 1e-7))
        rim, largest = concentration(results, SIDE / points)
        case.show(f"{points} x {points} points: largest E strain / mean stress at a point [-]",
                  largest)
        case.near(f"{points} x {points} points: stress concentration at the rim [-]", rim, HOWLAND,
                  relative=allowed)
        if points == 200:
            case.near("   the same from the field stress [-]",
                      concentration_of_stress(results, SIDE / points), HOWLAND, relative=0.03)
        case.above("   more than in an infinite plate", rim, KIRSCH)
    h = elastic.history
    case.near("full pull: lower reaction over upper [-]",
              h["bottom_reaction_y"][-1] / h["top_reaction_y"][-1], -1.0,
              relative=1e-4)

    broken = case.run("failure.nml")
    body = broken.layer == 0
    x = broken.points
    first = next((k for k in range(broken.outputs) if broken.field("damage", k).max() > 0), None)
    case.equal("the plate breaks", first is not None, True)
    if first is not None:
        h = broken.history
        row = int(np.argmax(h["broken_bonds"] > 0))
        case.show("part of the pull at which it breaks [-]", h["time"][row])
        damage = broken.field("damage", broken.outputs - 1)
        crack = body & (damage > 0.38)
        columns = np.unique(np.round(x[body & (np.abs(x[:, 0]) > RADIUS)][:, 0], 9))
        torn = np.unique(np.round(x[crack][:, 0], 9))
        case.equal("columns beside the hole that the crack has crossed",
                   f"{np.isin(columns, torn).sum()} of {len(columns)}",
                   f"{len(columns)} of {len(columns)}")
        # Three spacings: the two rows next to the crack carry damage above 0.38 where it is a
        # little rough
        case.below("largest distance of the crack from the middle, in spacings",
                   np.abs(x[crack, 1]).max() / spacing, 3.0)
        # It starts at the hole: damage comes there first, on both sides, and at the edge last;
        # rows are load steps, and the plate may tear within one
        began = {name: int(np.argmax(h[f"{name}_damage"] > 0))
                 for name in ("left_side", "right_side", "between", "edge")}
        case.equal("the hole's sides are damaged as soon as bonds break",
                   began["left_side"] == began["right_side"] == row, True)
        case.equal("   the middle between hole and edge not before them, the edge last",
                   row <= began["between"] <= began["edge"], True)
    if case.options.pictures:
        pictures(case, elastic, small, broken, spacing)
    case.finish()


def pictures(case, elastic, small, broken, spacing):
    """The line through the hole beside the classical solution, and the plate before and after."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from plot import draw, save
    figure = plt.figure(figsize=(11, 7.5))
    draw(figure, (2, 2, 1), elastic, "displacement_y", -1, "elastic, full pull: $u_y$", 1.0)
    axis = figure.add_subplot(2, 2, 2)
    r = np.linspace(1, 5, 200)
    q = 1 / r**2
    # Kirsch: E times the strain along the load, sigma_yy - nu sigma_xx, over the stress far away
    axis.plot(1e3 * RADIUS * r, 1 + q / 2 + 1.5 * q**2 - (1.5 * q - 1.5 * q**2) / 3, color="0.6",
              linewidth=2,
              label="infinite plate")
    x, stress = ligament(small, spacing)
    axis.plot(1e3 * x, stress, "o-", color="tab:red", markersize=3, linewidth=0.8, label="perifort")
    axis.set(xlabel="x [mm]", ylabel="E strain / mean stress",
             title="along the line through the hole")
    axis.legend()
    axis.grid(alpha=0.3)
    draw(figure, (2, 2, 3), broken, "damage", -1, "broken: damage", 1.0)
    axis = figure.add_subplot(2, 2, 4)
    h = broken.history
    axis.plot(h["time"], 1e-3 * h["top_reaction_y"] / THICKNESS * 1e-3, ".-", markersize=3,
              linewidth=0.8)
    axis.set(xlabel="part of the full pull", ylabel="reaction per thickness [kN/mm]",
             title="reaction of the upper layer")
    axis.grid(alpha=0.3)
    save(figure, case.folder / "plate.png", dpi=80)


main()
