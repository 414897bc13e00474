"""A block under uniaxial tension of 200 MPa, bond-based (nu = 1/4) and state-based (nu = 0.3)."""
import numpy as np
from common import Case, change
from discrete import Lattice, without_rigid_motion

MODULUS, STRESS, SPACING, RATIO = 200e9, 200e6, 0.01, 3.015
RATIOS = {"bond_based": 0.25, "state_based": 0.3}


def small_load(case, scene, nu):
    """The scene under a millionth of the load, against the linear solution of the discrete
    equations.
    """
    small = case.scene(scene).replace("-200.0e6", "-200.0")
    results = case.run(scene.replace(".nml", "_small.nml"),
                       change(small, "output", fields="'displacement'"))
    points = results.points
    lattice = Lattice(points, SPACING, RATIO * SPACING, MODULUS, nu)
    load = np.zeros_like(points)
    load[:, 0] = np.where(np.abs(points[:, 0]) > 0.49,
                          np.sign(points[:, 0]) * STRESS * 1e-6 / SPACING, 0.0)
    discrete = without_rigid_motion(points, lattice.statics(load))
    u = without_rigid_motion(points, results.field("displacement"))
    return np.abs(u - discrete).max() / np.abs(discrete).max()


def main():
    case = Case(__file__, __doc__)
    runs = {}
    for model, nu in RATIOS.items():
        results = runs[model] = case.run(f"{model}.nml")
        u, x = results.field("displacement"), results.points
        right, upper = results.nearest([0.255, 0.0, 0.0]), results.nearest([0.0, 0.045, 0.0])
        # Ten points across leave a third of them near a surface: the method's own error on this
        # block
        case.near(f"{model}: u_x(0.255, 0, 0) [m]", u[right, 0], STRESS * x[right, 0] / MODULUS,
                  relative=0.02)
        case.near(f"{model}: u_y(0, 0.045, 0) [m]", u[upper, 1],
                  -nu * STRESS * x[upper, 1] / MODULUS,
                  relative=0.11)
        case.near(f"{model}: u_z at the corresponding point over u_y [-]",
                  u[results.nearest([0.0, 0.0, 0.045]), 2] / u[upper, 1], 1.0, relative=1e-6)
        case.near(f"{model}: strain energy over the work of the loads [-]",
                  results.history["strain_energy"][-1] / results.history["external_work"][-1], 1.0,
                  relative=0.002)
        case.below(f"{model}, small loads: distance from the discrete solution [-]",
                   small_load(case, f"{model}.nml", nu), 1e-6)
    if case.options.pictures:
        picture(runs, case.folder / "block.png")
    case.finish()


def picture(runs, path):
    """The block in perspective, and displacements along its axis and across it beside the classical
    ones.
    """
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from plot import draw, save
    figure = plt.figure(figsize=(11, 6.5))
    draw(figure, (2, 2, 1), runs["bond_based"], "displacement_x", -1, "bond-based, $\\nu = 1/4$",
         0.0)
    draw(figure, (2, 2, 2), runs["state_based"], "displacement_y", -1, "state-based, $\\nu = 0.3$",
         0.0)
    for number, (axis_of, name) in enumerate([(0, "u_x$ along the axis"),
                                              (1, "u_y$ across the middle")], 3):
        axis = figure.add_subplot(2, 2, number)
        for (model, results), colour in zip(runs.items(), ("tab:blue", "tab:red")):
            near = results.points[results.nearest([0.005, 0.005, 0.005])]
            others = [c for c in range(3) if c != axis_of]
            line = np.all(np.abs(results.points - near)[:, others] < 1e-6, axis=1)
            x = results.points[line, axis_of]
            factor = 1.0 if axis_of == 0 else -RATIOS[model]
            axis.plot(x, 1e3 * factor * STRESS * x / MODULUS, color=colour, linewidth=1,
                      label=f"classical, {model}")
            axis.plot(x, 1e3 * results.field("displacement")[line, axis_of], ".", color=colour,
                      markersize=4,
                      label=f"perifort, {model}")
        axis.set(xlabel=f"{'xy'[axis_of]} [m]", ylabel="displacement [mm]", title=f"${name}")
        axis.legend(fontsize=7)
        axis.grid(alpha=0.3)
    save(figure, path, dpi=80)


main()
