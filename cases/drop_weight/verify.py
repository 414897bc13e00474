"""A striker of 5 kg falls on a notched beam: impulse and momentum of striker and beam, energy, a straight crack along
the plane of symmetry. A slow striker beside handbook formulas: stress intensity factor, opening of the notch's mouth,
load at which the notch grows. --quick: coarse points, without the slow striker.
"""
import re
import sys
from pathlib import Path

import numpy as np

CASES = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(CASES), str(CASES / "fracture")]
from common import Case  # noqa: E402
from measures import crack, rayleigh_speed, spacing_of, time_at  # noqa: E402

YOUNG, NU, DENSITY, TOUGHNESS = 31.37e9, 0.2, 2400.0, 31.1
DEPTH, THICKNESS, SPAN, NOTCH = 76.2e-3, 25.4e-3, 203.2e-3, 19.05e-3
MASS, SPEED, GRAVITY = 5.0, 0.5, 9.81


def bending(load):
    """Stress intensity factor [Pa m^1/2] and opening of the mouth [m] of a notched beam bent by a load in its middle,
    in plane stress, for any span (Guinea, Pastor, Planas and Elices, Int. J. Fracture 89 (1998) 103).
    """
    a, b = NOTCH / DEPTH, SPAN / DEPTH
    stress = 1.5 * load * SPAN / (THICKNESS * DEPTH**2)
    long = 1.99 + 0.83 * a - 0.31 * a**2 + 0.14 * a**3
    four = 1.9 + 0.41 * a + 0.51 * a**2 - 0.17 * a**3
    k = np.sqrt(a) / ((1 - a)**1.5 * (1 + 3 * a)) * (long + 4 / b * (four - long))
    v = 0.8 - 1.7 * a + 2.4 * a**2 + 0.66 / (1 - a)**2 + 4 / b * (-0.04 - 0.58 * a + 1.47 * a**2 - 2.04 * a**3)
    return stress * np.sqrt(DEPTH) * k, 4 * stress * NOTCH / YOUNG * v


def placed(text, rows):
    """The scene on other points: the striker and the supports touch the two points next to their middle."""
    half = DEPTH / rows / 2
    text = text.replace("points = 288, 96", f"points = {3 * rows}, {rows}")
    for radius, sign in ((25.4e-3, 1), (12.7e-3, -1)):
        reach = np.sqrt((radius + half)**2 - half**2) - half
        level = DEPTH + reach + 1e-7 if sign > 0 else -reach
        text = re.sub(rf"(centre = \S+), \S+(\n  radius = {1e3 * radius:.1f}e-3)", rf"\g<1>, {level:.9f}\2", text)
    return text


def slow(case):
    """A heavy striker at 20 mm/s bends the beam in quasi-static equilibrium until the notch grows."""
    text = placed(case.scene("beam.nml"), 48)
    for old, new in (("gravity = 0.0, -9.81", "gravity = 0.0, 0.0"), ("mass = 5.0", "mass = 1.0e3"),
                     ("velocity_y = -0.5", "velocity_y = -0.02"), ("stiffness = 10", "stiffness = 2"),
                     ("duration = 320.0e-6", "duration = 2.0e-3"), ("interval = 20.0e-6", "interval = 200.0e-6"),
                     ("history_every = 4", "history_every = 20")):
        assert old in text, old
        text = text.replace(old, new)
    text += """
&j_integral
  name = 'notch'
  lower = -12.7e-3, 6.35e-3
  upper = 12.7e-3, 31.75e-3
  direction = 0.0, 1.0
/
"""
    results = case.run("slow.nml", text)
    h, tip = results.history, results.tip("tip")
    # The mean of both ends' forces leaves out the inertia of the beam between them; means over some 3 of its vibrations
    load = (h["striker_force_y"] - h["left_force_y"] - h["right_force_y"]) / 2
    begin = time_at(tip, 2 * spacing_of(results))
    early = (h["time"] > 0.3e-3) & (h["time"] < min(begin, 1.3e-3))
    factor, opening = bending(load[early].mean())
    case.near("slow striker: stress intensity factor over the handbook's", h["notch_K_I"][early].mean() / factor, 1.0,
              absolute=0.08)
    # The probe lies beside the notch, half a spacing above the lower side; the opening grows from the tip on
    above = 1 - spacing_of(results) / 2 / NOTCH
    case.near("   opening of the notch's mouth over the handbook's",
              2 * h["mouth_displacement_x"][early].mean() / (opening * above), 1.0, absolute=0.08)
    # The straight line of the load over time, which leaves out the vibration, at the time of growth
    before = (h["time"] > 0.3e-3) & (h["time"] < begin)
    reached = float(np.polyval(np.polyfit(h["time"][before], load[before], 1), begin))
    case.near("   load as the notch begins to grow [N], beside K = (E Gc)^1/2", reached,
              np.sqrt(YOUNG * TOUGHNESS) / bending(1.0)[0], relative=0.1)
    case.below("   largest gap of the energy balance [-]", results.balance(), 0.01)
    return results


def main():
    case = Case(__file__, __doc__)
    text = case.scene("beam.nml")
    if case.options.quick:
        text = placed(text, 48)
    results = case.run("beam.nml", text)
    h, tip, dx = results.history, results.tip("tip"), spacing_of(results)
    t = np.asarray(h["time"])
    mass = DENSITY * results.volume
    case.near("mass of the beam [kg]", mass.sum(), DENSITY * 0.2286 * DEPTH * THICKNESS, relative=1e-9)
    struck = np.trapezoid(h["striker_force_y"], t)
    carried = -np.trapezoid(h["left_force_y"] + h["right_force_y"], t)
    change = MASS * (h["striker_velocity_y"][-1] - h["striker_velocity_y"][0])
    case.near("striker: change of its momentum [N s], impulse of contact and weight", change,
              struck - MASS * GRAVITY * t[-1], relative=1e-3)
    moved = float(np.sum(mass * results.field("velocity")[:, 1]))
    case.near("beam: its momentum [N s], impulse of striker, supports and weight", moved,
              carried - struck - mass.sum() * GRAVITY * t[-1], absolute=1e-3 * struck)
    case.below("   largest gap of the energy balance [-]", results.balance(), 0.01)
    case.show("   energy that the striker lost [J]", 0.5 * MASS * (SPEED**2 - h["striker_velocity_y"][-1]**2))
    force = h["striker_force_y"]
    case.show("   largest force on the striker [N], and the static one at growth", force.max(),
              np.sqrt(YOUNG * TOUGHNESS) / bending(1.0)[0])

    hit = float(t[np.argmax(force > 0)])
    begin = time_at(tip, 2 * dx)
    # The beam bends by its inertia alone: no wave reaches the supports before this
    felt = float(t[np.argmax(np.abs(h["left_force_y"]) > 0.01 * force.max())])
    fast, _, rayleigh = rayleigh_speed(YOUNG, NU, DENSITY, "stress")
    case.above("   supports: 1 % of the force after the impact [s], later than a wave", felt - hit,
               np.hypot(SPAN / 2, DEPTH) / fast)
    case.show("   crack: start of growth after the impact [s]", begin - hit)
    x = crack(results)
    case.below("   crack: largest distance from the plane of symmetry, in spacings", np.abs(x[:, 0]).max() / dx, 3)
    case.above("   height that it reaches over the depth", x[:, 1].max() / DEPTH, 0.9)
    image = crack(results) * [-1.0, 1.0]
    case.below("   cracked points without a mirror image [part]",
               float(np.mean([np.abs(x - p).sum(axis=1).min() > 0.1 * dx for p in image])), 0.02)
    speed = (0.6 * DEPTH - NOTCH) / (time_at(tip, 0.6 * DEPTH - NOTCH) - begin)
    case.below("   its mean speed up to 0.6 of the depth [m/s], of Rayleigh's", speed, rayleigh)
    area = (x[:, 1].max() - NOTCH) * THICKNESS
    case.show("   energy of broken bonds over Gc times the area", h["dissipated_energy"][-1] / (TOUGHNESS * area))
    bent = None if case.options.quick else slow(case)
    if case.options.pictures:
        pictures(case, results, bent)
    case.finish()


def pictures(case, results, bent):
    """Damage at two times, forces over time, the slow striker beside the handbook, and a film."""
    from perifort.pictures.layout import new_figure
    from plot import figure_of_fields, save, small_film
    figure_of_fields([(results, "damage", f"{1e6 * results.times[k]:.0f} us", k) for k in (7, results.outputs - 1)],
                     case.folder / "damage.png", columns=1, width=6.5, dpi=80, magnify=20.0)
    figure = new_figure(10.0, 3.4)
    left, right = figure.subplots(1, 2)
    h = results.history
    left.plot(1e6 * h["time"], h["striker_force_y"], label="striker")
    left.plot(1e6 * h["time"], -(h["left_force_y"] + h["right_force_y"]), label="supports")
    left.set(xlabel="time [us]", ylabel="force on the beam [N]", title="5 kg at 0.5 m/s", xlim=(0, 320))
    left.legend(fontsize=8)
    if bent is not None:
        h = bent.history
        load = (h["striker_force_y"] - h["left_force_y"] - h["right_force_y"]) / 2
        right.plot(1e3 * h["time"], 1e-6 * h["notch_K_I"], label="K of the J integral")
        right.plot(1e3 * h["time"], 1e-6 * bending(load)[0], linewidth=0.8, label="handbook, from the load")
        right.axhline(1e-6 * np.sqrt(YOUNG * TOUGHNESS), color="0.5", linestyle="--", label="(E Gc)^1/2")
        right.set(xlabel="time [ms]", ylabel="K [MPa m^1/2]", title="slow striker")
        right.legend(fontsize=8)
    save(figure, case.folder / "forces.png", dpi=80)
    small_film(results, "damage", case.folder / "film.gif")


main()
