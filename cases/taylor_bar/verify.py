"""A copper bar against a rigid wall (Taylor's test), beside finite elements of the same local material;
where the law for small strains stops being valid, and the one for large strains there; the bar in
tension. --quick takes 8 points across instead of 12 and leaves out the other speeds and the wall of
held points."""
import re
import sys
from pathlib import Path

import numpy as np
from common import Case, change

sys.path.insert(0, str(Path(__file__).resolve().parent))
from local import Material, impact  # noqa: E402

COPPER = Material(117e9, 0.35, 8930.0, 400e6, 100e6)
SOFT = Material(117e9, 0.35, 8930.0, 210e6, 425e6)  # of impact.nml
RADIUS, SPEED, DURATION = 3.81e-3, 50.0, 26e-6
# Points across the bar: points along it, and of the points with |x| > a |y| > b spacings outside the
# circle the corners (a, b)
SIZES = {12: (37, ((5, 2), (4, 4), (2, 5))), 8: (25, ((3, 2), (2, 3)))}
# Simo's bar at 227 m/s: length and radius of the foot after 80 us, by converged elements (README)
# Length after 210 m/s over the initial length, measured: 15.0 of 23.47 mm (README)
MEASURED = 0.64
PUBLISHED = {"length": 21.42e-3, "foot": 7.22e-3}


class Bar:
    """A run, its bar and its numbers."""

    def __init__(self, results, across, speed):
        self.results, self.speed = results, speed
        self.spacing = 2 * RADIUS / across
        self.length = SIZES[across][0] * self.spacing
        x = results.points
        body = results.layer == 0
        radius = np.hypot(x[:, 0], x[:, 1])
        first = body & (np.abs(x[:, 2] - self.spacing / 2) < 0.1 * self.spacing)
        self.rim = first & (radius > radius[first].max() - 0.3 * self.spacing)
        self.foot = first
        self.shortening = -results.history["top_displacement_z"]
        self.rest = int(np.argmax(self.shortening))
        moving = results.history["kinetic_energy"][0]
        self.plastic = results.history["plastic_energy"][self.rest] / moving

    def growth(self):
        """Of the radius of the bar's surface half a spacing above the wall, over the radius."""
        x = self.results.points[self.rim]
        y = x + self.results.field("displacement")[self.rim]
        return np.mean(np.hypot(y[:, 0], y[:, 1]) / np.hypot(x[:, 0], x[:, 1])) - 1

    def lowest(self):
        """The lowest of the points next to the wall, in spacings above it."""
        z = self.results.points[self.foot, 2]
        return np.min(z + self.results.field("displacement")[self.foot, 2]) / self.spacing

    def local(self, duration, small=False, material=COPPER):
        """The same bar of a local material, and the growth of its radius at the same place."""
        bar = impact(self.length, RADIUS, self.speed, duration, material, (8, 48), small)
        row = self.spacing / 2 / (self.length / 48)
        return bar, np.interp(row, np.arange(49), bar.r[:, -1]) / RADIUS - 1


def corners(across):
    """The groups that cut the circle out of the square."""
    spacing, text = 2 * RADIUS / across, ""
    for a, b in SIZES[across][1]:
        for x in (1, -1):
            for y in (1, -1):
                ends = [sorted((x * a * spacing, x * 0.01)), sorted((y * b * spacing, y * 0.01))]
                lower, upper = ([f"{end[i]:.10g}" for end in ends] for i in (0, 1))
                text += (f"&remove\n  shape = 'box'\n  lower = {', '.join(lower)}, -0.1\n"
                         f"  upper = {', '.join(upper)}, 0.1\n/\n")
    return text


def resized(text, across):
    """A scene of 12 points across with another number of them, as long in diameters or nearly so."""
    found = re.search(r"points = 12, 12, (\d+)", text)
    along = int(found.group(1))
    both = 2 if along == 2 * SIZES[12][0] else 1
    along = both * SIZES[across][0] if both == 2 else along * across // 12
    half = along * RADIUS / across
    text = change(text, "body", lower=f"{-RADIUS}, {-RADIUS}, {-half:.10g}",
                  upper=f"{RADIUS}, {RADIUS}, {half:.10g}", points=f"{across}, {across}, {along}")
    first, last = text.index("&remove"), text.index("&material")
    text = text[:first] + corners(across) + text[last:]
    return re.sub(r"point = 0.0, 0.0, (-?)\S+", lambda sign: f"point = 0.0, 0.0, {sign.group(1)}{half:.10g}",
                  text)


def held(text):
    """bar.nml with the upper bar alone, on a layer of points that are held along z and free to the sides."""
    text = change(text, "body", lower=f"{-RADIUS}, {-RADIUS}, 0.0", points=f"12, 12, {SIZES[12][0]}")
    first = text.index("&region\n  name = 'lower'")
    last = text.index("&initial")
    text = text[:first] + text[last:]
    text = re.sub(r"&initial\n  region = 'lower'.*?^/", "&boundary\n  name = 'wall'\n  side = 'z_min'\n"
                  "  velocity_z = 0.0\n/", text, flags=re.S | re.M)
    return re.sub(r"&probe\n  name = 'bottom'.*?^/", "", text, flags=re.S | re.M)


def collide(case, name, across=12, speed=SPEED, duration=DURATION, safety=None, wall=False):
    """Run bar.nml, or a variant of it."""
    text = case.scene("bar.nml")
    if across != 12:
        text = resized(text, across)
    if wall:
        text = held(text)
    if safety is not None:
        text = change(text, "time", safety=safety)
    text = text.replace("velocity_z = -50.0", f"velocity_z = {-speed}")
    text = text.replace("velocity_z = 50.0", f"velocity_z = {speed}")
    text = change(text, "time", duration=duration)
    return Bar(case.run(name, None if text == case.scene("bar.nml") else text), across, speed)


def strike(case, across):
    """impact.nml, at 210 m/s, beside the elements."""
    text = case.scene("impact.nml")
    if across == 8:
        results = case.run("impact.nml")
    else:
        spacing, along = 2 * RADIUS / across, SIZES[across][0]
        text = change(text, "body", upper=f"{RADIUS}, {RADIUS}, {along * spacing:.10g}",
                      points=f"{across}, {across}, {along}")
        first, last = text.index("&remove"), text.index("! The yield stress")
        text = text[:first] + corners(across) + "\n" + text[last:]
        text = re.sub(r"point = .*", f"point = 0.0, 0.0, {along * spacing:.10g}", text)
        results = case.run(f"impact_{across}.nml", text)
    bar = Bar(results, across, 210.0)
    local, growth = bar.local(80e-6, material=SOFT)
    length = 1 - bar.shortening.max() / bar.length
    case.near(f"210 m/s, large strains, {across} across: least length over initial length [-]",
              length, 1 - local.shortening.max() / bar.length, relative=0.08)
    case.near("   measured after the test", length, MEASURED, relative=0.08)
    case.near("   growth of the foot's radius [%]", 100 * bar.growth(), 100 * growth, relative=0.15)
    change_of_volume = results.field("dilatation")
    case.below("   largest change of the volume of a point [-]", np.abs(change_of_volume).max(), 0.05)
    case.above("   least distance of two points, in spacings", nearest(bar), 0.2)
    case.below("   largest gap of the energy balance [-]", results.balance(), 3e-3)
    return bar


def nearest(bar):
    """The least distance of two points in the end, in spacings."""
    from scipy.spatial import cKDTree
    y = bar.results.points + bar.results.field("displacement")
    return cKDTree(y).query(y, 2)[0][:, 1].min() / bar.spacing


def tension(case, across):
    """Modulus and flow stress of a pulled bar, over those of the material: the stress is the layers'
    reaction over the area, the strain that of the middle third, at the first and at the last load step.
    """
    text = case.scene("tension.nml")
    if across == 12:
        results = case.run("tension.nml")
    else:
        results = case.run(f"tension_{across}.nml", resized(text, across))
    body = results.layer == 0
    x, h = results.points, results.history
    spacing = 2 * RADIUS / across
    area = np.sum(results.volume[body]) / (np.ptp(x[body, 2]) + spacing)
    middle = body & (np.abs(x[:, 2]) < np.ptp(x[body, 2]) / 6)
    stress, strain = [], []
    for output in (1, -1):
        u = results.field("displacement", output)
        time = results.times[output]
        row = int(np.argmin(np.abs(h["time"] - time)))
        stress.append(h["top_reaction_z"][row] / area)
        strain.append(np.polyfit(x[middle, 2], u[middle, 2], 1)[0])
    plastic = strain[1] - stress[1] / COPPER.youngs_modulus
    limit = COPPER.yield_stress + COPPER.hardening * plastic
    return stress[0] / strain[0] / COPPER.youngs_modulus, stress[1] / limit


def main():
    case = Case(__file__, __doc__)
    quick = case.options.quick
    across = 8 if quick else 12

    simo = impact(32.4e-3, 3.2e-3, 227.0, 80e-6, COPPER, (6, 60))
    case.near("the elements here, 227 m/s: length after 80 us [mm]",
              1e3 * (32.4e-3 - simo.shortening[-1]), 1e3 * PUBLISHED["length"], relative=0.002)
    case.near("   radius of the foot [mm]", 1e3 * simo.foot[-1], 1e3 * PUBLISHED["foot"],
              relative=0.02)

    bar = collide(case, "bar.nml" if across == 12 else "bar_8.nml", across)
    local, growth = bar.local(DURATION)
    linear, wider = bar.local(DURATION, small=True)
    results, h = bar.results, bar.results.history
    # Measured: 15 % at 8 across, 3 % at 12, 1 % at 16, where less of the bar is surface
    allowed = 0.2 if quick else 0.05
    case.near(f"50 m/s, {across} across: largest shortening [mm], small strains",
              1e3 * bar.shortening.max(), 1e3 * linear.shortening.max(), relative=0.05)
    case.near("   growth of the foot's radius [%]", 100 * bar.growth(), 100 * wider, relative=allowed)
    case.near("   largest shortening [mm], large strains", 1e3 * bar.shortening.max(),
              1e3 * local.shortening.max(), relative=0.1)
    case.near("   growth of the foot's radius [%]", 100 * bar.growth(), 100 * growth, relative=0.15)
    case.show("   length over initial length [-]", 1 - bar.shortening.max() / bar.length,
              1 - local.shortening.max() / bar.length)
    moving = 0.5 * COPPER.density * SPEED**2 * np.pi * RADIUS**2 * bar.length
    case.near("   plastic over initial kinetic energy, at rest [-]", bar.plastic,
              local.plastic[np.argmax(local.shortening)] / moving, relative=0.02)
    case.show("   at rest after [us]", 1e6 * h["time"][bar.rest],
              1e6 * local.time[np.argmax(local.shortening)])
    case.below("   largest gap of the energy balance [-]", results.balance(), 3e-3)
    case.near("   dissipated energy is plastic [-]", h["plastic_energy"][-1] / h["dissipated_energy"][-1],
              1.0, relative=1e-12)
    case.equal("   plastic energy never falls", bool(np.all(np.diff(h["plastic_energy"]) >= 0)), True)
    mass = COPPER.density * results.volume[:, None]
    drift = np.sum(mass * results.field("velocity"), axis=0)
    case.below("   momentum of both bars over that of one [-]",
               np.abs(drift).max() / (np.sum(mass) / 2 * SPEED), 1e-12)
    apart = np.abs(h["top_displacement_z"] + h["bottom_displacement_z"]).max()
    case.below("   the two bars differ by [m]", apart, 1e-12)
    y = results.points + results.field("displacement")
    upper = results.points[:, 2] > 0
    case.above("   lowest point above the wall, in spacings", y[upper, 2].min() / bar.spacing, 0.0)

    coarse = bar if quick else collide(case, "bar_8.nml", 8)
    half = collide(case, "bar_8_half.nml", 8, safety=0.4)
    order = np.log2(coarse.results.balance() / half.results.balance())
    case.show("8 across: gap of the energy balance [-]", coarse.results.balance())
    case.near("   its order in the time step [-]", order, 2.0, absolute=0.5)
    case.below("   shortening with half the step, difference [-]",
               abs(half.shortening.max() / coarse.shortening.max() - 1), 0.005)

    modulus, flow = tension(case, across)
    case.near(f"tension, {across} across: stiffness over E [-]", modulus, 1.0, absolute=0.1)
    case.near("   stress after yielding over the material's [-]", flow, 1.0, absolute=0.08)

    hard = strike(case, 8)

    fast = None
    if not quick:
        strike(case, 12)
        wall = collide(case, "wall.nml", wall=True)
        case.show("wall of held points, 50 m/s: largest shortening [mm]", 1e3 * wall.shortening.max(),
                  1e3 * local.shortening.max())
        case.show("   growth of the foot's radius [%]", 100 * wall.growth(), 100 * growth)
        for speed, duration in ((25.0, 14e-6), (100.0, 45e-6), (210.0, 60e-6)):
            other = collide(case, f"bar_8_{speed:.0f}.nml", 8, speed=speed, duration=duration)
            beside, wider = other.local(duration)
            case.show(f"8 across, {speed:.0f} m/s: largest shortening [mm], large strains",
                      1e3 * other.shortening.max(), 1e3 * beside.shortening.max())
            case.show("   growth of the foot's radius [%]", 100 * other.growth(), 100 * wider)
            case.show("   lowest point above the wall, in spacings", other.lowest())
            if speed == 100.0:
                fast = other
    if case.options.pictures and not quick:
        pictures(case, bar, local, fast, hard)
    case.finish()


def pictures(case, bar, local, fast, hard):
    """Cuts through the bar beside the local solution, for small strains at 50 and 100 m/s and for large
    ones at 210 m/s, and shortening over time."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from plot import save
    figure, axes = plt.subplots(1, 4, figsize=(16, 4.5))
    for axis, run in zip(axes, (bar, fast, hard)):
        duration = run.results.history["time"][-1]
        beside = run.local(duration, material=SOFT if run is hard else COPPER)[0]
        x, u = run.results.points, run.results.field("displacement")
        cut = (np.abs(x[:, 1]) < run.spacing) & (x[:, 1] > 0)
        y = 1e3 * (x + u)[cut]
        drawn = axis.scatter(y[:, 0], y[:, 2], c=1e3 * np.abs(u[cut, 2]), s=22, cmap="viridis")
        for side in (1, -1):
            for end in (1,) if run is hard else (1, -1):
                axis.plot(1e3 * side * np.append(beside.r[:, -1], beside.r[-1, ::-1]),
                          1e3 * end * np.append(beside.z[:, -1], beside.z[-1, ::-1]), color="tab:red",
                          linewidth=1)
        axis.axhline(0.0, color="0.5", linewidth=0.6)
        axis.set(aspect="equal", xlim=(-8, 8) if run is hard else (-6, 6),
                 ylim=(-1, 17) if run is hard else (-8, 8), xlabel="x [mm]", ylabel="z [mm]",
                 title=f"{run.speed:.0f} m/s after {1e6 * duration:.0f} us")
        figure.colorbar(drawn, ax=axis, label="$|u_z|$ [mm]", shrink=0.8)
    h = bar.results.history
    linear = bar.local(DURATION, small=True)[0]
    axes[3].plot(1e6 * local.time, 1e3 * local.shortening, color="tab:red", label="elements, large strains")
    axes[3].plot(1e6 * linear.time, 1e3 * linear.shortening, "--", color="tab:red",
                 label="elements, small strains")
    axes[3].plot(1e6 * h["time"], 1e3 * bar.shortening, color="tab:blue", label="perifort, 50 m/s")
    axes[3].set(xlabel="time [us]", ylabel="shortening [mm]")
    axes[3].legend()
    axes[3].grid(alpha=0.3)
    save(figure, case.folder / "bar.png", dpi=80)


main()
