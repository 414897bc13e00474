"""The linear discrete problem of a lattice body, assembled and solved apart from the program.

For small displacements the discrete equations of peridynamics are K u = b. Here K comes from the
text of the theory with numpy and scipy alone: neighbours by a KD-tree, linear volume correction,
surface correction by energy, and K kept as a product of sparse factors, for in three dimensions its
rows would have thousands of entries. What the program computes under small loads must agree with
the solution to the tolerance of its relaxation, so a slip in either shows.

The material parameters are derived here too, in another way than the program's: the energy of a
point under uniform strain is equated to the classical one (see `Lattice`).
"""
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg, splu
from scipy.spatial import cKDTree


class Lattice:
    """Points of a cubic lattice with their bonds and the linear operator of their forces.

    points (n, dim) [m]; spacing [m]; horizon [m]; section: thickness [m] in 2D, area [m2] in 1D;
    youngs_modulus [Pa]; poissons_ratio [-], in 2D for plane stress, without meaning in 1D; both
    may be arrays over the points (n): each end of a bond has its own material. `cut` (from, to):
    bonds of points on different sides of these segments of the plane (m, 2) are broken from the
    start; the factors of surfaces are those of the body before that.
    """

    def __init__(self, points, spacing, horizon, youngs_modulus, poissons_ratio=0.0, section=1.0,
                 cut=()):
        n, dim = points.shape
        self.n, self.dim = n, dim
        self.volume = spacing**dim * section
        shear = youngs_modulus / (2 * (1 + poissons_ratio))
        if dim == 3:
            bulk = youngs_modulus / (3 * (1 - 2 * poissons_ratio))
            sphere = 4 * np.pi / 3
        elif dim == 2:
            bulk = youngs_modulus / (2 * (1 - poissons_ratio))
            sphere = np.pi * section
        else:
            bulk = shear = 0.0
            sphere = 2 * section
        # The stretch under uniform strain e is n.e.n. Over the family of the continuum the integral
        # of 1/|xi| times it, weighted by d delta, must be the dilatation tr e; that gives d. The
        # same integral of s^2 |xi| with the fourth moments of n gives b from pure shear and a from
        # expansion.
        # Integral of |xi|^power over the family
        over_family = lambda power: sphere * dim * horizon**(dim + power) / (dim + power)
        if dim == 1:
            self.d_delta = 1 / over_family(0)
            b_delta = youngs_modulus / 2 / over_family(1)
            self.a = 0.0
            uniaxial = youngs_modulus / 2
        else:
            self.d_delta = dim / over_family(0)
            # <(2 n1 n2)^2> = 4/(dim (dim + 2)) against an energy of mu gamma^2/2 at gamma = 2
            b_delta = 2 * shear / (over_family(1) * 4 / (dim * (dim + 2)))
            # Isotropic: s = 1, theta = dim; energy kappa dim^2/2
            self.a = (bulk * dim**2 / 2 - b_delta * over_family(1)) / dim**2
            uniaxial = (bulk + 2 * shear * (1 - 1 / dim)) / 2
        pairs = cKDTree(points).query_pairs(horizon * (1 + 1e-9), output_type="ndarray")
        bond = points[pairs[:, 1]] - points[pairs[:, 0]]
        length = np.linalg.norm(bond, axis=1)
        normal = bond / length[:, None]
        edge = np.clip((horizon + spacing / 2 - length) / spacing, 0.0, 1.0)
        weight = edge * self.volume
        i, j = pairs.T
        both = lambda values: np.bincount(i, values, n) + np.bincount(j, values, n)

        # Surface factors from a uniaxial strain along each direction
        dilatation = np.ones((n, dim))
        energy = np.ones((n, dim))
        for c in range(dim):
            stretch = normal[:, c]**2
            theta = self.d_delta * both(stretch * weight)
            stored = b_delta * both(stretch**2 * length * weight)
            dilatation[:, c] = np.divide(1.0, theta, where=theta > 0, out=dilatation[:, c])
            energy[:, c] = np.divide(uniaxial - self.a, stored, where=stored > 0, out=energy[:, c])
        factor = lambda g: 1 / np.sqrt(((normal / (0.5 * (g[i] + g[j])))**2).sum(axis=1))
        self.dilatation_factor, self.energy_factor = factor(dilatation), factor(energy)
        intact = np.ones(len(length), bool)
        for start, end in cut:
            intact &= ~crosses(points[i], points[j], np.asarray(start), np.asarray(end))
        # both ends supply half of a bond's law, each with its own material
        b_delta = np.broadcast_to(b_delta, n)
        b_delta = (b_delta[i] + b_delta[j])[intact] / 2
        i, j, length, normal, weight = (v[intact] for v in (i, j, length, normal, weight))
        self.dilatation_factor = self.dilatation_factor[intact]
        self.energy_factor = self.energy_factor[intact]

        # stretch of every bond = B u, dilatation of every point = T s, and by virtual work
        # V K = B' C B with C from the energy V sum(a theta^2 + b delta sum_bonds G s^2 |xi| w)
        m = len(length)
        rows = np.repeat(np.arange(m), dim)
        column = lambda p: (p[:, None] * dim + np.arange(dim)).ravel()
        slope = (normal / length[:, None]).ravel()
        self.stretch = sp.csr_matrix((np.concatenate([slope, -slope]),
                                      (np.concatenate([rows, rows]),
                                       np.concatenate([column(j), column(i)]))), shape=(m, n * dim))
        self.transposed = self.stretch.T.tocsr()
        self.bond_law = 4 * b_delta * self.energy_factor * length * weight
        theta_of = self.d_delta * self.dilatation_factor * weight
        self.theta = sp.csr_matrix((np.concatenate([theta_of, theta_of]),
                                    (np.concatenate([i, j]), np.tile(np.arange(m), 2))),
                                   shape=(n, m))
        self.theta_transposed = self.theta.T.tocsr()

    def apply(self, u):
        """K u: minus the force density of small displacements u (n dim, point by point) [N/m3]."""
        s = self.stretch @ u
        stress = self.bond_law * s
        if np.any(self.a != 0.0):
            stress = stress + self.theta_transposed @ (2 * self.a * (self.theta @ s))
        return self.transposed @ stress

    def matrix(self):
        """K as a sparse matrix; for few or short-ranged bonds."""
        law = sp.diags(self.bond_law)
        if np.any(self.a != 0.0):
            a = sp.diags(np.broadcast_to(2.0 * self.a, self.n))
            law = law + self.theta_transposed @ a @ self.theta
        return (self.transposed @ law @ self.stretch).tocsc()

    def statics(self, load, held=None, imposed=None):
        """Displacements (n, dim) under a force density (n, dim) [N/m3].

        `held` (n, dim), true where the displacement is that of `imposed` (n, dim), by default 0.
        Without it the body is free, the load must be in balance, and a rigid motion of the answer
        means nothing.
        """
        u = np.zeros(self.n * self.dim) if imposed is None else np.where(held, imposed, 0.0).ravel()
        b = load.ravel() - self.apply(u)
        free = np.ones(b.size, bool) if held is None else ~held.ravel()
        if self.dim < 3 and held is not None:
            factors = splu(self.matrix()[free][:, free])
            # refined, for bodies whose parts differ much in stiffness
            for _ in range(4):
                u[free] += factors.solve((load.ravel() - self.apply(u))[free])
            return u.reshape(self.n, self.dim)
        def product(v):
            full = np.zeros(b.size)
            full[free] = v
            return self.apply(full)[free]
        size = int(free.sum())
        scale = np.zeros(b.size)
        squared = self.stretch.copy()
        squared.data **= 2
        scale = (squared.T @ self.bond_law)[free]
        solver = LinearOperator((size, size), matvec=product)
        part, status = cg(solver, b[free], rtol=1e-11, maxiter=20000, M=sp.diags(1 / scale))
        if status != 0:
            raise RuntimeError("the conjugate gradients did not converge")
        u[free] = part
        return u.reshape(self.n, self.dim)


def crosses(a, b, start, end):
    """Whether the lines a b (m, 2) cross the segment from start to end."""
    side = lambda p, q, r: ((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])
    return ((side(start, end, a) * side(start, end, b) < 0)
            & (side(a, b, start) * side(a, b, end) < 0))


def without_rigid_motion(points, u):
    """Displacements (n, dim) less their mean translation and mean (small) rotation."""
    dim = points.shape[1]
    x = points - points.mean(axis=0)
    u = u - u.mean(axis=0)
    modes = []
    for a in range(dim):
        for b in range(a + 1, dim):
            mode = np.zeros_like(x)
            mode[:, a], mode[:, b] = -x[:, b], x[:, a]
            modes.append(mode.ravel())
    if modes:
        modes = np.array(modes).T
        turn, *_ = np.linalg.lstsq(modes, u.ravel(), rcond=None)
        u = u - (modes @ turn).reshape(u.shape)
    return u


def vibration(lattice, held, density, start, step, point, steps):
    """Displacement of one point of a chain over steps of the leapfrog rule, from rest at `start`.

    Exact for the discrete system in space and time: in its modes the rule turns a frequency omega
    into 2 arcsin(omega step/2)/step and changes nothing else. held (n): points that stay at 0.
    """
    free = np.flatnonzero(~held)
    stiffness = lattice.matrix()[free][:, free].toarray()
    squared, modes = np.linalg.eigh(0.5 * (stiffness + stiffness.T) / density)
    angle = 2 * np.arcsin(np.clip(0.5 * step * np.sqrt(np.maximum(squared, 0)), 0, 1))
    amplitude = modes[list(free).index(point)] * (modes.T @ start[free])
    return np.concatenate([np.cos(np.outer(part, angle)) @ amplitude
                           for part in np.array_split(np.asarray(steps),
                                                      max(1, len(steps) // 500))])
