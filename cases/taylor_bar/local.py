"""The Taylor bar of a local material, apart from the program: explicit finite elements.

Axisymmetric elements of four nodes with one point and viscous hourglass control; von Mises plasticity
with linear isotropic hardening, by the radial return; large strains with Jaumann's rate, or small ones, with
stress and equilibrium in the undeformed bar. The wall is a plane that the foot of the bar neither leaves nor
rubs on, the same as the symmetry plane of the scenes.
"""
from dataclasses import dataclass

import numpy as np


@dataclass
class Material:
    """Elastic-plastic, in SI units."""
    youngs_modulus: float
    poissons_ratio: float
    density: float
    yield_stress: float
    hardening: float


@dataclass
class Impact:
    """A solution. Arrays over the steps, but for the last two: the nodes at the end (rows from the
    foot up, columns from the axis out).
    """
    time: np.ndarray        # [s]
    shortening: np.ndarray  # of the bar [m]
    foot: np.ndarray        # radius of the foot at the wall [m]
    plastic: np.ndarray     # plastic work [J]
    push: np.ndarray        # force of the wall on the bar, positive in compression [N]
    r: np.ndarray
    z: np.ndarray


def geometry(r, z, quads):
    """Radii of the corners, gradients of the shape functions times the area, areas."""
    radii, heights = r[quads], z[quads]
    along_r = (heights[[1, 2, 3, 0]] - heights[[3, 0, 1, 2]]) / 2
    along_z = (radii[[3, 0, 1, 2]] - radii[[1, 2, 3, 0]]) / 2
    return radii, along_r, along_z, (radii * along_r).sum(0)


def impact(length, radius, speed, duration, material, cells, small=False):
    """A cylinder whose end z = 0 is stopped at t = 0 by a wall; `cells`: (across, along); `small`: the
    theory of small strains.
    """
    elastic = material.youngs_modulus / (1 + material.poissons_ratio)
    mu, kappa = elastic / 2, material.youngs_modulus / (3 * (1 - 2 * material.poissons_ratio))
    sound = np.sqrt((kappa + 4 * mu / 3) / material.density)
    across, along = cells
    r, z = (a.ravel() for a in np.meshgrid(np.linspace(0, radius, across + 1),
                                           np.linspace(0, length, along + 1)))
    first = (np.arange(along)[:, None] * (across + 1) + np.arange(across)).ravel()
    quads = np.stack([first, first + 1, first + across + 2, first + across + 1])
    foot, axis, end = z < 1e-12, r < 1e-12, z > length - 1e-12
    start = np.stack([r, z])
    radii, _, _, area = geometry(r, z, quads)
    # Per radian, like all forces here; to each node the quarter of the rectangle next to it
    mass = np.bincount(quads.ravel(), (material.density * area
                                       * (radii + radii.mean(0)) / 8).ravel(), len(r))
    speeds = np.zeros((2, len(r)))
    speeds[1, ~foot] = -speed
    stress = np.zeros((4, len(area)))  # rr, zz, around the axis, rz
    strain = np.zeros(len(area))       # equivalent plastic
    work, time, rows = 0.0, 0.0, []
    hourglass = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    while time < duration:
        place = start if small else np.stack([r, z])
        _, _, _, area = geometry(*place, quads)
        diagonal = np.maximum(np.hypot(*(place[:, quads[2]] - place[:, quads[0]])),
                              np.hypot(*(place[:, quads[3]] - place[:, quads[1]])))
        step = 0.5 * np.min(area / diagonal) / sound
        # Rates in the middle of the step, so that a rotation leaves no strain at first order
        half = start if small else place + step / 2 * speeds
        radii, along_r, along_z, area = geometry(*half, quads)
        u, w = speeds[0][quads], speeds[1][quads]
        rate = np.stack([(along_r * u).sum(0) / area, (along_z * w).sum(0) / area,
                         u.mean(0) / radii.mean(0)])
        u_z, w_r = (along_z * u).sum(0) / area, (along_r * w).sum(0) / area
        spin, shear, volume = (u_z - w_r) / 2, (u_z + w_r) / 2, rate.sum(0)
        if small:
            spin = 0 * spin
        turned = np.stack([2 * spin * stress[3], -2 * spin * stress[3], 0 * spin,
                           spin * (stress[1] - stress[0])])
        stress = stress + step * turned
        stress[:3] += step * (2 * mu * (rate - volume / 3) + kappa * volume)
        stress[3] += step * 2 * mu * shear
        pressure = stress[:3].mean(0)
        stress[:3] -= pressure
        mises = np.sqrt(1.5 * ((stress[:3]**2).sum(0) + 2 * stress[3]**2))
        limit = material.yield_stress + material.hardening * strain
        flow = np.maximum(mises - limit, 0) / (3 * mu + material.hardening)
        stress *= 1 - 3 * mu * flow / np.maximum(mises, 1.0)
        stress[:3] += pressure
        strain = strain + flow
        r, z = r + step * speeds[0], z + step * speeds[1]
        place = start if small else np.stack([r, z])
        radii, along_r, along_z, area = geometry(*place, quads)
        centre = radii.mean(0)
        work += 2 * np.pi * np.sum(flow * (limit + material.hardening * flow / 2) * area * centre)
        # Of the corners' speeds the part that no strain of the element sees
        seen = hourglass - ((hourglass * radii).sum(0) * along_r
                            + (hourglass * place[1][quads]).sum(0) * along_z) / area
        damping = 0.0125 * material.density * sound * np.sqrt(area) * centre * seen
        pull = np.stack([(along_r * stress[0] + along_z * stress[3]) * centre + area * stress[2] / 4
                         + damping * (seen * u).sum(0),
                         (along_z * stress[1] + along_r * stress[3]) * centre
                         + damping * (seen * w).sum(0)])
        force = np.stack([np.bincount(quads.ravel(), -p.ravel(), len(r)) for p in pull])
        speeds = speeds + step * force / mass
        speeds[0, axis], speeds[1, foot] = 0.0, 0.0
        time += step
        rows.append((time, length - z[end].mean(), r[foot].max(), work,
                     -2 * np.pi * force[1, foot].sum()))
    shape = (along + 1, across + 1)
    return Impact(*np.array(rows).T, r.reshape(shape), z.reshape(shape))
