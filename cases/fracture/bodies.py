"""Bodies without a notch: the Brazilian disc and Winkler's panel."""
import re

import numpy as np
from common import change
from measures import crack, slope_angle

YOUNG, NU, STRETCH, THICKNESS, DIAMETER = 20e9, 0.2, 1e-4, 0.02, 0.05


def write_disc(path, across):
    """The points of a square lattice within a circle, as a cloud. Returns the spacing [m]."""
    dx = DIAMETER / across
    centres = (np.arange(across) + 0.5) * dx - DIAMETER / 2
    x, y = np.meshgrid(centres, centres)
    inside = x**2 + y**2 <= (DIAMETER / 2)**2
    with open(path, "w", encoding="utf-8") as file:
        file.write("# x y z volume\n")
        for a, b in zip(x[inside], y[inside]):
            file.write(f"{a:.15g} {b:.15g} 0 {dx**2 * THICKNESS:.15g}\n")
    return dx


def pressed(text, displacement, values="0.0, 0.8, 1.2"):
    """The scene with both platens moved inwards by so much [m] times the course's values."""
    text = text.replace("displacement_y = -1.0e-6", f"displacement_y = {-displacement:.9e}")
    text = text.replace("displacement_y = 1.0e-6", f"displacement_y = {displacement:.9e}")
    return text.replace("values = 0.0, 0.8, 1.2", f"values = {values}")


def running(text, displacement, duration=180e-6):
    """The scene in time: platens that move so far [m] at one speed, slow beside the disc's waves."""
    text = re.sub(r"^  (times|values) = .*\n", "", text, flags=re.M)
    for sign in ("-", ""):
        text = text.replace(f"displacement_y = {sign}1.0e-6",
                            f"velocity_y = {sign}{displacement / duration:.9e}")
    text = text.replace("method = 'relaxation'", f"duration = {duration:.6e}")
    text = re.sub(r"^&relaxation.*?^/\n", "", text, flags=re.M | re.S)
    text = re.sub(r"^  every = .*$", "  interval = 1.0e-6", text, flags=re.M)
    return change(text.replace("'displacement', 'strain', 'damage'", "'damage'"), "material",
                  density=2700.0)


def brazilian(case):
    """Load at the first break against the elastic disc's, and the crack along the diameter.

    In the middle the stress across the load is 2 P/(pi D t), and -6 P/(pi D t) along it
    (Timoshenko and Goodier, section 41): bonds across are stretched by (1 + 3 nu) 2 P/(pi D t E).
    """
    case.out.mkdir(parents=True, exist_ok=True)
    dx = write_disc(case.out / "disc.txt", 40 if case.options.quick else 80)
    scene = case.scene("brazilian.nml")
    known = STRETCH * np.pi * DIAMETER * THICKNESS * YOUNG / (2 * (1 + 3 * NU))
    # How far the platens go for this load: from the elastic disc
    text = change(change(pressed(scene, 1e-6), "material", critical_stretch=1.0), "relaxation",
                  load_steps=1)
    elastic = case.run("brazilian_elastic.nml", text, threads=case.threads)
    load = abs(float(elastic.boundary("top").reaction_y[-1]))
    moved = 1.2e-6 * known / load
    middle = elastic.nearest((0.0, 0.0))
    strain = float(elastic.field("strain_xx")[middle]) * known / load
    case.near("Brazilian disc: strain across in the middle at the expected load", strain, STRETCH,
              relative=0.02)
    results = case.run("brazilian.nml", pressed(scene, moved), threads=case.threads)
    broken = np.asarray(results.history["broken_bonds"])
    first = int(np.flatnonzero(broken > 0)[0]) if broken.any() else 0
    side = results.boundary("top")
    # Between the row before the first break and the row of it, along the elastic line
    stiffness = load / 1.2e-6
    reached = stiffness * abs(float(side.displacement_y[first] + side.displacement_y[first - 1])) / 2
    case.near("   load at the first break [N]", reached if first else np.nan, known, relative=0.05)
    # A crack of 0.15 of the diameter in the middle may grow up to a quarter of the radius from the
    # platens. Without it the strain is nearly the same everywhere along the diameter, and bonds
    # break in many places at once. It runs in time: in static equilibrium it would do so in one load step
    text = scene.replace("x^2 + y^2 > (0.15*0.025)^2", "abs(y) > 0.75*0.025")
    text = running(text, 1.15 * moved) + "&crack\n  from = 0.0, -0.00375\n  to = 0.0, 0.00375\n/\n"
    results = case.run("brazilian_crack.nml", text, threads=case.threads)
    # Looked at when it has just come through, before the halves break up
    last, cover, x = results.outputs - 1, 0.0, np.zeros((0, 2))
    for output in range(results.outputs):
        x = crack(results, output, threshold=0.3)
        rows = np.unique(np.round(x[np.abs(x[:, 0]) < 3 * dx, 1] / dx - 0.5))
        cover = len(rows) * dx / (0.75 * DIAMETER)
        if cover > 0.9:
            last = output
            break
    case.below("   crack: largest distance from the diameter, in spacings",
               np.abs(x[:, 0]).max() / dx if len(x) else np.inf, 3.0)
    case.above("   part of the diameter that may break which it covers", cover, 0.9)
    return [(results, "damage", "Brazilian disc", last)]


def l_panel(case):
    """Path of the crack of Winkler's panel from the inner corner."""
    text = case.scene("l_panel.nml")
    if case.options.quick:
        text = change(text, "body", points="50, 50")
    results = case.run("l_panel.nml", text, threads=case.threads)
    dx = 0.5 / (50 if case.options.quick else 100)
    x = crack(results, threshold=0.3)
    if len(x) == 0:
        case.equal("L panel: a crack grows", "no", "yes")
        return []
    distance = np.hypot(x[:, 0] - 0.25, x[:, 1] - 0.25)
    case.below("L panel: nearest cracked point to the inner corner, in spacings",
               distance.min() / dx, 2.0)
    near = x[distance < 0.1]
    angle = 180 - slope_angle(near, (0.25, 0.25))
    case.above("   first 100 mm: angle above the horizontal [degrees]", angle, 0.0)
    case.below("   and no more than", angle, 45.0)
    case.above("   crack: extent to the left of the corner [m]", 0.25 - x[:, 0].min(), 0.1)
    for place in (0.2, 0.15, 0.1):
        at = x[np.abs(x[:, 0] - place) < 0.6 * dx]
        case.show(f"   height above the corner at x = {1e3 * place:.0f} mm [m]",
                  float(at[:, 1].mean() - 0.25) if len(at) else np.nan)
    side = results.boundary("lift")
    case.show("   largest load [N]; in the experiments 7 to 8 kN",
              float(np.max(np.abs(side.reaction_y))))
    return [(results, "damage", "L panel")]
