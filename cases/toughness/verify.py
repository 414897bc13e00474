"""How tough lattices are: a few rows of the program's table, and a lattice that is not in it, against
a solve of its own, with sparse matrices. --all: every row. --write: renew the table in the sources."""
import argparse
import os
import re
import subprocess
import sys
import tempfile
from fractions import Fraction
from pathlib import Path

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

TABLE = Path(__file__).resolve().parents[2] / "src/perifort/set_up/toughness/table.f90"
TOLERANCE = 1e-3         # of G: both solves are converged to some 1e-5
LEAD, COUNTED = 0.7, 2.0  # growth before anything counts [horizons], and that counts then [spacings]
KINDS = ["none", "linear", "linear_extended", "exact"]

THIRD = Fraction(1, 3)
# dimension, volume correction, horizon, Poisson's ratio of 3D or plane stress. Plane strain is the
# plane stress of nu/(1 - nu): 1/5, 1/4, 3/10, 1/3 and 2/5 are 1/4, 1/3, 3/7, 1/2 and 2/3
ROWS = [(2, "linear", "3.015", nu) for nu in map(Fraction, (
    "1/5", "22/100", "1/4", "3/10", "33/100", "1/3", "35/100", "2/5", "3/7", "1/2", "2/3"))]
ROWS += [(2, kind, "3.015", THIRD) for kind in ("none", "linear_extended", "exact")]
ROWS += [(2, "linear", "4.015", nu) for nu in (Fraction(1, 4), THIRD)]
ROWS += [(3, "linear", "3.015", nu) for nu in map(Fraction, ("1/5", "1/4", "3/10", "1/3", "2/5"))]


def part_inside(offset, horizon, n=400):
    """The part of a square cell within the horizon, by the trapezoidal rule along x."""
    x = offset[0] + (np.arange(n) + 0.5) / n - 0.5
    height = np.sqrt(np.maximum(horizon**2 - x**2, 0))
    upper = np.minimum(offset[1] + 0.5, height)
    return float(np.mean(np.maximum(upper - np.maximum(offset[1] - 0.5, -height), 0)))


def family(dim, kind, horizon):
    """Offsets, and the part of the other end's volume that counts."""
    reach = horizon + {"linear_extended": 0.5, "exact": 0.5 * np.sqrt(dim)}.get(kind, 0)
    m = int(reach)
    steps, parts = [], []
    for i in range(-m, m + 1):
        for j in range(-m, m + 1):
            for k in range(-m, m + 1) if dim == 3 else [0]:
                r = np.sqrt(i * i + j * j + k * k)
                if r == 0 or r > reach * (1 + 1e-9):
                    continue
                part = {"none": 1.0, "exact": None}.get(kind, min(1.0, horizon + 0.5 - r))
                part = part_inside((i, j), horizon) if part is None else part
                if part > 0:
                    steps.append((i, j, k))
                    parts.append(part)
    return np.array(steps), np.array(parts)


class Disc:
    """A disc around the tip of a crack, with Young's modulus, spacing and Gc 1. `along`: the stress
    along the crack (T) where K is 1."""

    def __init__(self, dim, kind, horizon, nu, diagonal, radius=None, along=0.0):
        self.radius, self.along = radius or max(28.0, 5 * horizon), along
        self.nu, self.flat, self.diagonal = nu, dim == 3, diagonal
        self.mu = 1 / (2 * (1 + nu))
        self.steps, parts = family(dim, kind, horizon)
        length = np.linalg.norm(self.steps, axis=1)
        if dim == 3:
            kappa = 1 / (3 * (1 - 2 * nu))
            self.a = (kappa - 5 * self.mu / 3) / 2
            b, d = 15 * self.mu / (2 * np.pi * horizon**5), 9 / (4 * np.pi * horizon**4)
            uniaxial = (kappa + 4 * self.mu / 3) / 2
            self.s_c = ((3 * self.mu + 0.75**4 * (kappa - 5 * self.mu / 3)) * horizon) ** -0.5
        else:
            kappa = 1 / (2 * (1 - nu))
            self.a = (kappa - 2 * self.mu) / 2
            b, d = 6 * self.mu / (np.pi * horizon**4), 2 / (np.pi * horizon**3)
            uniaxial = (kappa + self.mu) / 2
            self.s_c = ((6 * self.mu / np.pi + 16 * (kappa - 2 * self.mu) / (9 * np.pi**2))
                        * horizon) ** -0.5
        if abs(self.a) < 1e-12:
            self.a = 0.0
        square = (self.steps[:, 0] / length) ** 2
        q = 2 * (uniaxial - self.a) / np.sum(square**2 * length * parts)
        t = 1 / np.sum(square * parts)        # both with the surface factors of a whole family
        assert 0.8 < q / (2 * b * horizon) < 1.3 and 0.8 < t / (d * horizon) < 1.3
        self.build(parts, length, q, t)

    def build(self, parts, length, q, t):
        """Points, bonds and the matrices of their stretches and dilatations."""
        reach = self.steps.max()
        outer = self.radius + 2 * reach
        n = int(outer) + 2
        i, j = (c.ravel() for c in np.meshgrid(range(-n, n), range(-n, n), indexing="ij"))
        x, y = i + 0.5, j + 0.5
        keep = np.hypot(x, y) <= outer
        number = np.full((2 * n, 2 * n), -1)
        number[i[keep] + n, j[keep] + n] = np.arange(keep.sum())
        self.x, self.y, i, j = x[keep], y[keep], i[keep], j[keep]
        self.free = np.hypot(self.x, self.y) < self.radius
        self.ahead, self.above = self.x, self.y
        if self.diagonal:
            self.ahead = (self.x + self.y) / np.sqrt(2)
            self.above = (self.y - self.x - 0.5) / np.sqrt(2)
        lists = []
        for step, part, r in zip(self.steps, parts, length):
            if (step[1], step[0]) <= (0, 0) and (step[1] < 0 or step[0] <= 0) or step[2] < 0:
                continue
            a, b = i + step[0] + n, j + step[1] + n
            inside = (a >= 0) & (a < 2 * n) & (b >= 0) & (b < 2 * n)
            end = np.where(inside, number[np.clip(a, 0, 2 * n - 1), np.clip(b, 0, 2 * n - 1)], -1)
            k = np.nonzero(end >= 0)[0]
            each = 2 if step[2] else 1
            lists.append(np.column_stack([k, end[k], np.full(k.size, r), np.full(k.size, part * each),
                                          np.full(k.size, each), np.full(k.size, step[2])]))
        lists = np.concatenate(lists)
        self.k, self.l = lists[:, 0].astype(int), lists[:, 1].astype(int)
        r, part, self.each = lists[:, 2], lists[:, 3], lists[:, 4].astype(int)
        points, bonds = self.x.size, np.arange(self.k.size)
        nx, ny = (self.x[self.l] - self.x[self.k]) / r**2, (self.y[self.l] - self.y[self.k]) / r**2
        columns = np.concatenate([self.k, self.l, self.k + points, self.l + points])
        self.stretch = sparse.csr_matrix((np.concatenate([-nx, nx, -ny, ny]),
                                          (np.tile(bonds, 4), columns)))
        self.theta = sparse.csr_matrix((np.concatenate([t * part] * 2),
                                        (np.concatenate([self.k, self.l]), np.tile(bonds, 2))))
        self.stiffness = 2 * q * part * r
        y1, y2 = self.above[self.k], self.above[self.l]
        self.crosses = y1 * y2 < 0
        with np.errstate(divide="ignore", invalid="ignore"):
            place = self.ahead[self.k] + (self.ahead[self.l] - self.ahead[self.k]) * y1 / (y1 - y2)
        self.intact = ~(self.crosses & (place < -1e-9))
        across = (self.steps[:, 1] - self.steps[:, 0]) / np.sqrt(2) if self.diagonal \
            else self.steps[:, 1]
        self.per_length = np.abs(across).sum() / 2
        self.image = np.full(self.k.size, -1)
        if not self.diagonal:
            where = {(p, s): m for m, (p, s) in enumerate(zip(self.x, self.y))}
            mirror = np.array([where[p, -s] for p, s in zip(self.x, self.y)])
            place_of = {(min(k, m), max(k, m), s): b for b, (k, m, s) in
                        enumerate(zip(self.k, self.l, lists[:, 5]))}
            self.image = np.array([place_of[min(mirror[k], mirror[m]), max(mirror[k], mirror[m]), s]
                                   for k, m, s in zip(self.k, self.l, lists[:, 5])])

    def field(self, tip):
        """Displacements of the classical material at K = 1, with the stress along the crack."""
        r, angle = np.hypot(self.ahead - tip, self.above), np.arctan2(self.above, self.ahead - tip)
        kappa = 3 - 4 * self.nu if self.flat else (3 - self.nu) / (1 + self.nu)
        size = np.sqrt(r / (2 * np.pi)) / (2 * self.mu) * (kappa - np.cos(angle))
        strains = (1 - self.nu**2, -self.nu * (1 + self.nu)) if self.flat else (1, -self.nu)
        u = size * np.cos(angle / 2) + self.along * strains[0] * self.ahead
        v = size * np.sin(angle / 2) + self.along * strains[1] * self.above
        if self.diagonal:
            u, v = (u - v) / np.sqrt(2), (u + v) / np.sqrt(2)
        return np.concatenate([u, v])

    def grow(self):
        """G/Gc at which each bond breaks that counts."""
        period = np.sqrt(2) if self.diagonal else 1.0
        horizon = float(self.horizon)
        begun = round(self.per_length * period * round(LEAD * horizon / period))
        wanted = begun + round(self.per_length * period * round(COUNTED / period))
        modulus = 1 / (1 - self.nu**2) if self.flat else 1.0
        moving = self.free[self.k] | self.free[self.l]
        f = np.concatenate([self.free, self.free])
        B, T = self.stretch[:, f], self.theta
        rates, broken, factor, u = [], 0, None, None
        while broken < wanted:
            def product(v):
                s = self.intact * (B @ v)
                force = self.stiffness * s
                if self.a:
                    force = force + self.intact * (T.T @ (2 * self.a * (T @ s)))
                return B.T @ force
            held = np.where(f, 0, self.field(broken / self.per_length))
            s = self.intact * (self.stretch @ held)
            load = self.stiffness * s
            if self.a:
                load = load + self.intact * (T.T @ (2 * self.a * (T @ s)))
            right = -(B.T @ load)
            if factor is None or steps[0] > 60:
                A = (B.T @ sparse.diags(self.stiffness * self.intact) @ B).tocsc()
                factor = splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0,
                              options={"SymmetricMode": True})
            steps = [0]
            u, fault = cg(LinearOperator((right.size,) * 2, product), right, x0=u, rtol=1e-8,
                          atol=0, M=LinearOperator((right.size,) * 2, factor.solve),
                          callback=lambda _: steps.__setitem__(0, steps[0] + 1))
            assert fault == 0
            whole = held.copy()
            whole[f] = u
            s = np.where(self.intact & moving, self.stretch @ whole, 0)
            most = int(np.argmax(s))
            counts = broken >= begun
            for bond in {most, self.image[most]} - {-1}:
                if counts:
                    rates += [(self.s_c / s[most]) ** 2 / modulus] * self.each[bond]
                self.intact[bond] = False
                broken += self.each[bond] if self.crosses[bond] else 0
        return np.array(rates)


def toughness(dim, kind, horizon, nu, diagonal=False, radius=None, along=0.0):
    """G/Gc of all bonds that count."""
    disc = Disc(dim, kind, float(horizon), float(nu), diagonal, radius, along)
    disc.horizon = horizon
    return disc.grow()


def solve(row):
    """Largest and mean G/Gc, and the largest along diagonals."""
    straight = toughness(*row)
    return straight.max(), straight.mean(), toughness(*row, diagonal=True).max()


def number_text(value):
    """A number of the table in Fortran."""
    return f"{value.numerator}/{value.denominator}.0_wp" if value.denominator > 1000 or \
        value.denominator in (3, 7) else f"{float(value)}_wp"


def write():
    """Write the rows into the source."""
    lines = []
    for row in ROWS:
        dim, kind, horizon, nu = row
        values = solve(row)
        print(dim, kind, horizon, nu, *(f"{v:.4f}" for v in values), flush=True)
        lines.append(f"    & row_type({dim}, volume_{kind}, {horizon}_wp, {number_text(nu)}, "
                     + ", ".join(f"{v:.4f}_wp" for v in values) + ")")
    text = TABLE.read_text()
    begin, end = "  ! rows begin here\n", "  ! rows end here\n"
    rows = "  type(row_type), parameter :: rows(*) = [ &\n" + ", &\n".join(lines) + "]\n"
    TABLE.write_text(text[:text.index(begin) + len(begin)] + rows + text[text.index(end):])


def program(dim, kind, horizon, nu, critical="lattice"):
    """What `perifort check` says of a lattice: largest and mean G/Gc and the largest along diagonals;
    with 'chapter' its s_c alone."""
    text = f"""&scene
  dimension = {dim}
  {"thickness = 1.0" if dim == 2 else ""}
/
&body
  lower = {", ".join(["0.0"] * dim)}
  upper = {", ".join(["16.0"] * dim)}
  points = {", ".join(["16"] * dim)}
/
&material
  youngs_modulus = 1.0e9
  poissons_ratio = {float(nu):.17g}
  critical_energy_release_rate = 1.0
  critical = '{critical}'
/
&horizon
  ratio = {horizon}
  volume_correction = '{kind}'
/
&time
  method = 'relaxation'
/
"""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lattice.nml"
        path.write_text(text)
        out = subprocess.run([os.environ["PERIFORT"], "check", path], capture_output=True, text=True)
    if out.returncode:
        sys.exit(f"error: the program refuses a scene:\n{out.stderr}")
    if critical == "chapter":
        return float(re.search(r"crit\. stretch +(\S+)", out.stdout)[1])
    found = re.search(r"(\S+) Gc at most and (\S+) on average, at 45 degrees (\S+) Gc", out.stdout)
    return tuple(map(float, found.groups()))


def show_stress_along():
    """What the stress along the crack changes: T = 0.95 K/sqrt(h) in an arm of h = 30, 60 and 120 spacings."""
    print("nu, T sqrt(dx)/K: largest G/Gc over that without T, root: the load")
    for nu in map(Fraction, ("1/5", "1/3", "35/100", "2/5")):
        alone = toughness(2, "linear", "3.015", nu).max()
        for height in (30, 60, 120):
            along = 0.95 / np.sqrt(height)
            part = toughness(2, "linear", "3.015", nu, along=along).max() / alone
            print(f"{float(nu):.4g} {along:.3f}: {part:.3f} {np.sqrt(part):.3f}", flush=True)


def main():
    parser = argparse.ArgumentParser(prog="./pf verify toughness", description=__doc__)
    parser.add_argument("--all", action="store_true", help="every row of the table (some minutes)")
    parser.add_argument("--write", action="store_true", help="write the table into the sources")
    parser.add_argument("--quick", action="store_true", help="bond-based lattices alone")
    parser.add_argument("--stress-along", action="store_true",
                        help="what a stress along the crack changes, as in a double cantilever")
    options = parser.parse_args()
    if options.write:
        return write()
    if options.stress_along:
        return show_stress_along()
    rows = ROWS if options.all else [r for r in ROWS if r[:3] == (2, "linear", "3.015")
                                     and r[3] in (Fraction(1, 5), THIRD, Fraction(2, 3))]
    # the second is not in the table
    rows = rows[1:2] if options.quick else rows + [(2, "linear", "2.515", Fraction(1, 10))]
    missed = 0
    print("dim volume horizon nu: largest G/Gc, mean, largest at 45 degrees; program, this solve")
    for row in rows:
        found, own = program(*row), solve(row)
        # the program prints four digits
        near = all(abs(a - b) <= TOLERANCE * b for a, b in zip(found, own))
        missed += not near
        print(*row, *(f"{v:.4f}" for v in found), "|", *(f"{v:.4f}" for v in own),
              "ok" if near else "MISSED", flush=True)
    usual = toughness(2, "linear", "3.015", THIRD)
    larger = toughness(2, "linear", "3.015", THIRD, radius=56.0)
    near = abs(larger.max() / usual.max() - 1) < 0.01
    missed += not near
    print(f"a disc of 56 spacings: largest {larger.max():.4f}, mean {larger.mean():.4f}",
          "ok" if near else "MISSED")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
