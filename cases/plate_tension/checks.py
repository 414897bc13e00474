"""What is known of the book's plate under tension, and how its results are judged."""
import numpy as np

MODULUS, STRESS = 200e9, 200e6
# u_x at (0.255, 0) and u_y at (0, 0.245). Bond-based: what the book's own program gives.
# State-based: the linear discrete solution, found once with a program of its own
KNOWN = {"bond_based": (1 / 3, 2.549e-4, -8.23e-5), "state_based": (0.25, 2.5489e-4, -6.1755e-5)}


def strains(results):
    """The strains along x and y inside: away from the edges the surface correction has nothing to
    do and they are the classical ones to the error of the sums over families and that of finite
    strain, 0.001.
    """
    u, x = results.field("displacement"), results.points
    inner = (np.abs(x[:, 0]) < 0.3) & (np.abs(x[:, 1]) < 0.12)
    return [np.polyfit(x[inner, c], u[inner, c], 1)[0] for c in (0, 1)]


def judge(case, name, results, model):
    """Displacements at two points, strains inside and energy of a plate of 100 x 50 points."""
    nu, known_x, known_y = KNOWN[model]
    u = results.field("displacement")
    right, upper = results.nearest([0.255, 0.0]), results.nearest([0.0, 0.245])
    case.near(f"{name}: u_x(0.255, 0) [m]", u[right, 0], known_x, relative=0.005)
    case.near(f"{name}: u_y(0, 0.245) [m]", u[upper, 1], known_y, relative=0.005)
    case.show("   classical sigma x/E and -nu sigma y/E [m]",
              f"{STRESS * 0.255 / MODULUS:.4e}", f"{-nu * STRESS * 0.245 / MODULUS:.4e}")
    strain = strains(results)
    case.near(f"{name}: strain along x inside [-]", strain[0], STRESS / MODULUS, relative=0.005)
    case.near(f"{name}: strain along y inside [-]", strain[1], -nu * STRESS / MODULUS,
              relative=0.02)
    case.near(f"{name}: strain energy over the work of the loads [-]",
              results.history["strain_energy"][-1] / results.history["external_work"][-1], 1.0,
              relative=0.002)
