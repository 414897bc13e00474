"""A rigid ball of 10 mm hits a brittle disc of 74 x 2.5 mm with 100 m/s: radial and ring cracks, momentum, angular
momentum and energy, the ball's speed. A rigid sphere pressed into a layer beside Hertz.
"""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from common import Case  # noqa: E402

DENSITY, BALL_DENSITY, RADIUS, SPEED = 2200.0, 7800.0, 5e-3, 100.0
BALL = BALL_DENSITY * 4 / 3 * np.pi * RADIUS**3
# The layer: spacing, modulus, Poisson's ratio, time of pressing
SPACING, MODULUS, NU, TIME = 1e-3, 10e9, 0.25, 1e-4


def hertz(depth, radius, layer):
    """Force on a rigid sphere pressed into a layer that is bonded to a rigid ground: Hertz's, and by what factor the
    ground makes it larger (Dimitriadis et al., Biophys. J. 82 (2002) 2798).
    """
    a = -(1.2876 - 1.4678 * NU + 1.3442 * NU**2) / (1 - NU)
    b = (0.6387 - 1.0277 * NU + 1.5164 * NU**2) / (1 - NU)
    x, pi = np.sqrt(radius * depth) / layer, np.pi
    factor = (1 - 2 * a / pi * x + 4 * a**2 / pi**2 * x**2 - 8 / pi**3 * (a**3 + 4 * pi**2 / 15 * b) * x**3
              + 16 * a / pi**4 * (a**3 + 3 * pi**2 / 5 * b) * x**4)
    return 4 / 3 * MODULUS / (1 - NU**2) * np.sqrt(radius) * depth**1.5, factor


def pressed(case, across, rows, radius, contact):
    """Press a sphere until the contact has a radius of so many spacings; force over the known one at half the depth
    and at all of it, and by how much the ground raises the latter.
    """
    depth = contact**2 / radius * SPACING
    half, layer = across / 2 * SPACING, rows * SPACING
    text = f"""&scene
  dimension = 3
/
&body
  name = 'layer'
  lower = {-half}, {-half}, {-layer}
  upper = {half}, {half}, 0.0
  points = {across}, {across}, {rows}
/
&material
  youngs_modulus = {MODULUS}
  poissons_ratio = {NU}
  density = 1000.0
/
&boundary
  side = 'z_min'
  displacement_x = 0.0
  displacement_y = 0.0
  displacement_z = 0.0
/
&rigid
  name = 'ball'
  shape = 'sphere'
  centre = 0.0, 0.0, {radius * SPACING}
  radius = {radius * SPACING}
  rotation = 'held'
  displacement_x = 0.0
  displacement_y = 0.0
  displacement_z = '-{depth}*(t/{TIME})^2*(3 - 2*t/{TIME})'
/
&contact
  between = 'ball', 'layer'
  stiffness = 10
/
&time
  duration = {TIME}
/
&output
  every = 1000000
  history_every = 5
  fields = 'displacement'
/
"""
    h = case.run(f"layer_{contact}.nml", text).history
    found = []
    for part in (0.5, 1.0):
        i = int(np.argmin(np.abs(-h["ball_displacement_z"] - part * depth)))
        known, factor = hertz(-h["ball_displacement_z"][i], radius * SPACING, layer)
        found.append(h["ball_force_z"][i] / (known * factor))
    return *found, factor


def momenta(results, output):
    """Momentum of all along z, and angular momentum of all about the origin."""
    h = results.history
    i = int(np.argmin(np.abs(h["time"] - results.times[output])))
    ball = {what: np.array([h[f"ball_{what}_{c}"][i] for c in "xyz"]) for what in ("displacement", "velocity", "spin")}
    mass = DENSITY * results.volume[:, None]
    y, v = results.points + results.field("displacement", output), results.field("velocity", output)
    centre = np.array([0.0, 0.0, 5.1e-3]) + ball["displacement"]
    turning = np.sum(mass * np.cross(y, v), axis=0) + BALL * np.cross(centre, ball["velocity"]) \
        + 0.4 * BALL * RADIUS**2 * ball["spin"]
    return np.sum(mass * v, axis=0) + BALL * ball["velocity"], turning


def around(results, radius, threshold=0.3):
    """How many cracks cross a circle on the lower face, and the mean damage on it."""
    damage = results.field("damage")
    low = results.points[:, 2] == results.points[:, 2].min()
    spacing = 0.625e-3
    x, d = results.points[low], damage[low]
    r, angle = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    ring = np.abs(r - radius) < 0.8 * spacing
    order = np.argsort(angle[ring])
    open_ = d[ring][order] > threshold
    return int(np.sum(open_ & ~np.roll(open_, 1))), float(d[ring].mean())


def main():
    case = Case(__file__, __doc__)
    quick = case.options.quick
    sizes = [(24, 12, 24, 3.5)] if quick else [(24, 12, 24, 3.5), (48, 22, 64, 8)]
    for across, rows, radius, contact in sizes:
        half, whole, factor = pressed(case, across, rows, radius, contact)
        case.near(f"sphere in a layer, contact of {contact} spacings: force over the known one", whole, 1.0,
                  absolute=0.06)
        case.near("   at half the depth", half, 1.0, absolute=0.08)
        case.show("   by what the ground raises Hertz's force", factor)
    if quick:
        case.finish()

    results = case.run("ball.nml", threads=1)
    h = results.history
    first = momenta(results, 0)
    scale = BALL * SPEED
    drift = max(np.abs(momenta(results, k)[0] - first[0]).max() for k in range(results.outputs)) / scale
    turning = max(np.abs(momenta(results, k)[1] - first[1]).max() for k in range(results.outputs)) / (scale * 37e-3)
    case.below("ball and disc: momentum changes by, over that of the ball", drift, 1e-12)
    case.below("   angular momentum, over that at the rim", turning, 1e-12)
    case.below("   largest gap of the energy balance [-]", results.balance(), 0.02)
    speed = -h["ball_velocity_z"]
    case.near("   speed of the ball before [m/s]", speed[0], SPEED, relative=1e-12)
    case.show("   speed of the ball at the end [m/s]", speed[-1])
    case.below("   the ball speeds up by [m/s]", np.diff(speed).max(), 0.02)
    case.show("   energy that cracks took over what the ball lost [-]",
              h["dissipated_energy"][-1] / (0.5 * BALL * (SPEED**2 - speed[-1]**2)))
    case.show("   fragments at the end", h["fragments"][-1])
    for radius in (12e-3, 20e-3, 28e-3):
        count, mean = around(results, radius)
        case.show(f"   cracks across the circle of {1e3 * radius:.0f} mm, mean damage there {mean:.2f}", count)
    case.above("   cracks across the circle of 28 mm", around(results, 28e-3)[0], 5)
    if case.options.pictures:
        picture(case, results)
    case.finish()


def picture(case, results):
    """Damage of the lower face at two times, and speed and energies over time."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from plot import save
    figure, axes = plt.subplots(2, 2, figsize=(11, 9))
    axes = axes.ravel()
    low = results.points[:, 2] == results.points[:, 2].min()
    for axis, output in zip(axes, (2, results.outputs - 1)):
        y = 1e3 * results.points[low]
        drawn = axis.scatter(y[:, 0], y[:, 1], c=results.field("damage", output)[low], s=4.5, marker="s",
                             cmap="magma_r", vmin=0, vmax=1, linewidths=0)
        axis.set(aspect="equal", xlim=(-40, 40), ylim=(-40, 40), xlabel="x [mm]", ylabel="y [mm]",
                 title=f"lower face after {1e6 * results.times[output]:.0f} us")
        figure.colorbar(drawn, ax=axis, label="damage", shrink=0.8)
    h = results.history
    t = 1e6 * h["time"]
    axes[2].plot(t, -h["ball_velocity_z"])
    axes[2].set(xlabel="time [us]", ylabel="speed of the ball [m/s]")
    for name, label in (("ball_kinetic_energy", "motion of the ball"), ("kinetic_energy", "motion of all"),
                        ("dissipated_energy", "broken bonds"), ("strain_energy", "strain and contact")):
        axes[3].plot(t, h[name], label=label)
    axes[3].set(xlabel="time [us]", ylabel="energy [J]")
    axes[3].legend(fontsize=8)
    for axis in axes[2:]:
        axis.grid(alpha=0.3)
    save(figure, case.folder / "disc.png", dpi=80)


main()
