"""What a crack in a strip needs, spends and how fast it runs, against horizon, spacing, step and law."""
import re

import numpy as np
from common import change
from dynamics import GLASS
from measures import rayleigh_speed, speed_between, time_at

HEIGHT, TOUGHNESS, STORED = 0.02, 3.0, 2.0
# In statics the grips move up to so many times as far as in the running strip
FARTHER = 1.5
# Where energy and speed are taken [m]
FIRST, LAST = 0.016, 0.041

# Changes of the scene: spacings across the strip, horizon, step, when bonds break, law
ROWS = [
    ("3.015 spacings of 0.25 mm, safety 0.8", {}),
    ("horizon of 4.015 spacings", dict(ratio=4.015)),
    ("horizon of 5.015 spacings", dict(ratio=5.015)),
    ("horizon of 6.015 spacings", dict(ratio=6.015)),
    ("spacing 0.5 mm", dict(across=40)),
    ("spacing 0.125 mm", dict(across=160)),
    ("safety 0.4", dict(time=dict(safety=0.4))),
    ("safety 0.2", dict(time=dict(safety=0.2))),
    ("velocity_verlet", dict(time=dict(integrator="'velocity_verlet'"))),
    ("bonds break after the forces", dict(time=dict(breaking="'after_forces'"))),
    ("the same, safety 0.2", dict(time=dict(breaking="'after_forces'", safety=0.2))),
    ("critical = 'chapter'", dict(material=dict(critical="'chapter'"))),
    ("the same, 6.015 spacings", dict(material=dict(critical="'chapter'"), ratio=6.015)),
    ("bond-based, nu = 1/3", dict(material=dict(model="'bond_based'", poissons_ratio=1 / 3))),
    ("the same, critical = 'chapter'", dict(material=dict(
        model="'bond_based'", poissons_ratio=1 / 3, critical="'chapter'"))),
]


def strained(strain):
    """The gradient of the strip's displacement."""
    return {r"displacement_gradient\(2,2\)": f"{strain:.6e}"}


def scene_of(case, across=80, ratio=3.015, time=None, material=None):
    """The strip's text, and the strain that stores STORED times Gc per area ahead of the crack."""
    text = change(case.scene("strip.nml"), "body", points=f"{5 * across}, {across}")
    # Bonds break that lie within a horizon of the middle
    band = (ratio + 0.185) * HEIGHT / across
    text = text.replace("0.0008", f"{band:.6g}")
    text = text.replace("&time", f"&horizon\n  ratio = {ratio}\n/\n\n&time", 1)
    text = change(text, "material", **(material or {}))
    text = change(text, "time", **(time or {}))
    nu = (material or {}).get("poissons_ratio", GLASS["nu"])
    strain = np.sqrt(2 * STORED * TOUGHNESS * (1 - nu**2) / (GLASS["young"] * HEIGHT))
    return change(text, "initial", **strained(strain)).replace("\\", ""), strain


def standing(text, strain, across):
    """The same strip in static equilibrium, its grips drawn apart until the crack has run on."""
    text = re.sub(r"^&initial\b.*?^/\n", "", text, flags=re.M | re.S)
    edge = FARTHER * strain * (HEIGHT / 2) * (1 - 1 / across)
    for name, sign in (("top", 1), ("bottom", -1)):
        text = text.replace(f"name = '{name}'", f"name = '{name}'\n  displacement_x = 0.0\n"
                            f"  displacement_y = {sign * edge:.8e}", 1)
    lines = [line for line in text.splitlines() if "velocity_" not in line]
    text = "\n".join(lines) + "\n"
    start, end = text.index("&time"), text.index("&tip")
    return (text[:start] + "&time\n  method = 'relaxation'\n/\n\n&relaxation\n  growth = 'events'\n"
            "  tolerance = 1.0e-5\n  most_events = 40\n/\n\n&output\n  every = 1\n  fields = 'damage'\n"
            "  precision = 'single'\n/\n\n" + text[end:])


def sweep(case):
    """The table "Running cracks" of doc/trade.md: G where the crack starts in statics, energy per area, speed."""
    _, _, rayleigh = rayleigh_speed(**GLASS, plane="stress")
    rows = ROWS[:2] if case.options.quick else ROWS
    table = []
    for number, (what, changes) in enumerate(rows):
        across = changes.get("across", 80)
        text, strain = scene_of(case, **changes)
        still = None
        if "time" not in changes:
            slow = case.run(f"sweep_static_{number}.nml", standing(text, strain, across),
                            threads=case.threads)
            factor = np.asarray(slow.history["time"])
            still = STORED * (FARTHER * float(np.max(factor)))**2
        results = case.run(f"sweep_{number}.nml", text, threads=case.threads)
        tip, h = results.tip("tip"), results.history
        spent = np.interp([time_at(tip, FIRST), time_at(tip, LAST)], np.asarray(h["time"]),
                          np.asarray(h["dissipated_energy"]))
        held = float(np.diff(spent)[0]) / (LAST - FIRST) / TOUGHNESS
        speed = speed_between(tip, FIRST, LAST) / rayleigh
        table.append((what, still, held, speed))
    print("| strip | G at the start in statics, over Gc | held by bonds that broke, per area, over Gc "
          "| speed over Rayleigh's |\n|---|---|---|---|")
    for what, still, held, speed in table:
        print(f"| {what} | {'' if still is None else f'{still:.2f}'} | {held:.2f} | {speed:.2f} |")
    base = table[0]
    case.near("strip with the lattice's toughness: G at the start in statics, over Gc", base[1], 1.0,
              relative=0.05)
    return []
