"""A plate under uniaxial tension of 200 MPa, bond-based (nu = 1/3) and state-based (nu = 1/4)."""
import numpy as np
from common import Case, change
from discrete import Lattice, without_rigid_motion

MODULUS, STRESS, THICKNESS, SPACING, RATIO = 200e9, 200e6, 0.01, 0.01, 3.015
# u_x at (0.255, 0) and u_y at (0, 0.245). Bond-based: what the book's own program gives.
# State-based: the linear discrete solution, found once with a program of its own
KNOWN = {"bond_based": (1 / 3, 2.549e-4, -8.23e-5), "state_based": (0.25, 2.5489e-4, -6.1755e-5)}


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
    for model, (nu, known_x, known_y) in KNOWN.items():
        results = runs[model] = case.run(f"{model}.nml")
        u, x = results.field("displacement"), results.points
        right, upper = results.nearest([0.255, 0.0]), results.nearest([0.0, 0.245])
        case.near(f"{model}: u_x(0.255, 0) [m]", u[right, 0], known_x, relative=0.005)
        case.near(f"{model}: u_y(0, 0.245) [m]", u[upper, 1], known_y, relative=0.005)
        case.show("   classical sigma x/E and -nu sigma y/E [m]",
                  f"{STRESS * 0.255 / MODULUS:.4e}", f"{-nu * STRESS * 0.245 / MODULUS:.4e}")
        # Away from the edges the surface correction has nothing to do and the strain is the
        # classical one to the error of the sums over families and that of finite strain, 0.001
        inner = (np.abs(x[:, 0]) < 0.3) & (np.abs(x[:, 1]) < 0.12)
        strain = [np.polyfit(x[inner, c], u[inner, c], 1)[0] for c in (0, 1)]
        case.near(f"{model}: strain along x inside [-]", strain[0], STRESS / MODULUS,
                  relative=0.005)
        case.near(f"{model}: strain along y inside [-]", strain[1], -nu * STRESS / MODULUS,
                  relative=0.02)
        case.near(f"{model}: strain energy over the work of the loads [-]",
                  results.history["strain_energy"][-1] / results.history["external_work"][-1], 1.0,
                  relative=0.002)
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
