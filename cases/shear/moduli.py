"""Elastic moduli of an infinite square or cubic lattice of points, by sums over one family.

Under a uniform strain e the linearised stretch of a bond along n is n.e.n, every point is alike, and the energy
density is exactly quadratic in e (doc/theory.md, 1, 2):

    W = a theta^2 + b delta sum Gb (n.e.n)^2 |xi| vc V,    theta = d delta sum Gd (n.e.n) vc V

Nothing else enters, so these moduli are exact for small strains, and no run of the program is needed. The surface
factors of a point inside the body are the same in all directions: D of the dilatation and S of the stretches.

Written apart from the program: the part of a cell inside the horizon comes from scipy's quadrature.
"""
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.integrate import quad

RULES = ("linear", "linear_extended", "exact", "none")


def disc_in_rectangle(x1, x2, y1, y2, radius):
    """Area of the part of [x1, x2] x [y1, y2], with 0 <= x1 and 0 <= y1, inside a disc about 0."""
    def height(x):
        top = np.sqrt(max(0.0, radius**2 - x**2))
        return max(0.0, min(top, y2) - y1)
    # the height has a kink where the circle crosses the lower and the upper edge
    kinks = [np.sqrt(radius**2 - y**2) for y in (y1, y2) if y < radius]
    cuts = sorted({x1, x2, *(x for x in kinks if x1 < x < x2)})
    return sum(quad(height, low, high, epsabs=1e-12, epsrel=1e-12)[0]
               for low, high in zip(cuts, cuts[1:]))


@lru_cache(maxsize=None)
def covered(cell, ratio):
    """Part of the unit cell at `cell`, non-negative and sorted, inside the ball of radius `ratio`."""
    # The cells on an axis or a plane of symmetry are cut there: halves are alike
    low = [max(0.0, c - 0.5) for c in cell]
    high = [c + 0.5 for c in cell]
    whole = np.prod(np.array(high) - low)
    if np.sum(np.square(high)) <= ratio**2:
        return 1.0
    if np.sum(np.square(low)) >= ratio**2:
        return 0.0
    if len(cell) == 2:
        return disc_in_rectangle(low[0], high[0], low[1], high[1], ratio) / whole

    def slice_at(z):
        return disc_in_rectangle(low[0], high[0], low[1], high[1],
                                 np.sqrt(max(0.0, ratio**2 - z**2)))
    # the slice's area has kinks where the circle passes a corner
    corners = [np.sqrt(ratio**2 - x**2 - y**2) for x in (low[0], high[0]) for y in (low[1], high[1])
               if x**2 + y**2 < ratio**2]
    cuts = sorted({low[2], min(high[2], ratio), *(z for z in corners if low[2] < z < high[2])})
    return sum(quad(slice_at, low, high, epsabs=1e-10, epsrel=1e-10)[0]
               for low, high in zip(cuts, cuts[1:])) / whole


def family(dim, ratio, rule):
    """Bonds (n, dim) of a point in spacings, their lengths and volume corrections vc."""
    reach = {"linear": ratio, "none": ratio, "linear_extended": ratio + 0.5,
             "exact": ratio + 0.5 * np.sqrt(dim)}[rule]
    count = int(reach) + 1
    bonds = np.array([c for c in product(range(-count, count + 1), repeat=dim)
                      if 0 < np.dot(c, c) <= reach**2 * (1 + 1e-9)], dtype=float)
    length = np.linalg.norm(bonds, axis=1)
    if rule == "none":
        part = np.ones_like(length)
    elif rule == "exact":
        part = np.array([covered(tuple(sorted(abs(bond))), ratio) for bond in bonds])
    else:
        part = np.clip(ratio + 0.5 - length, 0.0, 1.0)
    return bonds, length, part


@lru_cache(maxsize=None)
def sums(dim, ratio, rule):
    """Lattice sums over the integrals that they stand for: (dilatation, n_x^4, n_x^2 n_y^2).

    Each is 1 in the limit of many points in a horizon.
    """
    bonds, length, part = family(dim, ratio, rule)
    n = bonds / length[:, None]
    sphere = 4 * np.pi if dim == 3 else 2 * np.pi   # of directions
    # mean over directions of n_x^2, n_x^4 and n_x^2 n_y^2
    square, fourth, mixed = (1 / 3, 1 / 5, 1 / 15) if dim == 3 else (1 / 2, 3 / 8, 1 / 8)
    ball = sphere * ratio**dim / dim                # integral of 1
    weighted = sphere * ratio**(dim + 1) / (dim + 1)  # integral of |xi|
    return (np.sum(n[:, 0]**2 * part) / (square * ball),
            np.sum(n[:, 0]**4 * length * part) / (fourth * weighted),
            np.sum(n[:, 0]**2 * n[:, 1]**2 * length * part) / (mixed * weighted))


class Moduli:
    """Moduli over the classical shear modulus mu, or over the classical modulus of the same name.

    `plane`: 'stress' or 'strain' in two dimensions. c11, c12, c66 in units of mu; `axial` and `diagonal`:
    the shear moduli in planes of the lattice's axes and at 45 degrees to them, over mu; `young` and `poisson`:
    of a pull along an axis, over E and nu; `bulk`: over kappa.
    """

    def __init__(self, dim, ratio, rule, nu, surface=True, plane="stress"):
        dilatation, fourth, mixed = sums(dim, ratio, rule)
        # kappa over mu, and the a of doc/theory.md, 1, over mu; E over mu is 2 (1 + nu)
        if dim == 3:
            kappa = 2 * (1 + nu) / (3 * (1 - 2 * nu))
            a = (kappa - 5 / 3) / 2
            classical = kappa + 4 / 3, kappa - 2 / 3
        else:
            kappa = (1 + nu) / (1 - nu) if plane == "stress" else 1 / (1 - 2 * nu)
            a = (kappa - 2) / 2
            classical = kappa + 1, kappa - 1
        if surface:
            # S makes c11 right with a dilatation that D makes right
            dilatation, mixed, fourth = 1.0, mixed / fourth, 1.0
        # the stretches alone make c11 = 3 mu and c12 = c66 = mu
        self.c11 = 2 * a * dilatation**2 + 3 * fourth
        self.c12 = 2 * a * dilatation**2 + mixed
        self.c66 = mixed
        self.axial = self.c66
        self.diagonal = (self.c11 - self.c12) / 2
        self.bulk = (self.c11 + (dim - 1) * self.c12) / dim / kappa

        def pulled(c11, c12):
            if dim == 3:
                return (c11 - c12) * (c11 + 2 * c12) / (c11 + c12), c12 / (c11 + c12)
            return c11 - c12**2 / c11, c12 / c11
        young, poisson = pulled(self.c11, self.c12)
        exact = pulled(*classical)
        self.young, self.poisson = young / exact[0], poisson / exact[1]


def table(dim, nu, ratios, plane="stress"):
    """The table of doc/trade.md as lines of Markdown."""
    lines = ["| horizon | surface correction | `volume_correction` | shear, axes | shear, 45 degrees | E | nu | kappa |",
             "|---|---|---|---|---|---|---|---|"]
    for ratio in ratios:
        for surface in (True, False):
            for rule in RULES:
                m = Moduli(dim, ratio, rule, nu, surface, plane)
                lines.append(f"| {ratio} dx | {'on' if surface else 'off'} | `{rule}` | {m.axial:.3f} | "
                             f"{m.diagonal:.3f} | {m.young:.3f} | {m.poisson:.3f} | {m.bulk:.3f} |")
    return lines


if __name__ == "__main__":
    for dimension, ratio_of_poisson in ((3, 0.25), (3, 0.3), (2, 1 / 3), (2, 0.25)):
        print(f"\n{dimension}D, nu = {ratio_of_poisson:.3g}")
        print("\n".join(table(dimension, ratio_of_poisson, (2.015, 3.015, 4.015, 5.015))))
