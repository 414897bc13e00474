"""A plate under uniaxial tension of 200 MPa, bond-based (nu = 1/3) and state-based (nu = 1/4)."""
import numpy as np
from checks import KNOWN, MODULUS, STRESS, judge
from common import Case, change
from discrete import Lattice, without_rigid_motion

THICKNESS, SPACING, RATIO = 0.01, 0.01, 3.015


def small_load(case, scene, nu):
    """The scene under a millionth of the load, against the linear solution of the discrete
    equations.
    """
    small = case.scene(scene).replace("-200.0e6", "-200.0")
    results = case.run(scene.replace(".nml", "_small.nml"),
                       change(small, "output", fields="'displacement'"))
    points = results.points[:, :2]
    lattice = Lattice(points, SPACING, RATIO * SPACING, MODULUS, nu, THICKNESS)
    load = np.zeros_like(points)
    load[:, 0] = np.where(np.abs(points[:, 0]) > 0.49,
                          np.sign(points[:, 0]) * STRESS * 1e-6 / SPACING, 0.0)
    discrete = without_rigid_motion(points, lattice.statics(load))
    u = without_rigid_motion(points, results.field("displacement")[:, :2])
    return np.abs(u - discrete).max() / np.abs(discrete).max()


def main():
    case = Case(__file__, __doc__)
    runs = {}
    for model, (nu, _, _) in KNOWN.items():
        runs[model] = case.run(f"{model}.nml")
        judge(case, model, runs[model], model)
        case.below(f"{model}, small loads: distance from the discrete solution [-]",
                   small_load(case, f"{model}.nml", nu), 1e-6)
    if case.options.pictures:
        from plot import figure_of_fields
        figure_of_fields([(runs["bond_based"], "displacement_x", "bond-based, $\\nu = 1/3$: $u_x$"),
                          (runs["bond_based"], "displacement_y", "$u_y$"),
                          (runs["state_based"], "displacement_x",
                           "state-based, $\\nu = 1/4$: $u_x$"),
                          (runs["state_based"], "displacement_y", "$u_y$")],
                         case.folder / "plate.png", columns=2, width=4.5, dpi=100)
    case.finish()


main()
