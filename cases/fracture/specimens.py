"""Specimens whose crack grows in static equilibrium: load against linear elastic fracture mechanics over growth.

A crack's length is that of the elastic body with the same compliance, with a crack cut from the
start; a cut crack is half a spacing longer than given. LEFM's load at that length is P_c = K_c B/...,
K_c = sqrt(E' Gc), E' = E in plane stress and E/(1 - nu^2) in plane strain.
"""
import re

import numpy as np
from common import change
from measures import spacing_of
from scipy.interpolate import CubicSpline

# What the program is asked for. GROWTH: 'load_steps', or 'events', in which one bond after the other
# breaks; CONTROL (with events): 'load' or 'dissipation', which follows a load that falls; CRITICAL:
# 'chapter', or 'lattice', the critical stretch from the lattice's own toughness
GROWTH, CONTROL, CRITICAL = "events", "load", "lattice"

YOUNG, TOUGHNESS, THICKNESS, SPACING = 3.24e9, 300.0, 0.005, 0.5e-3


def with_rules(text):
    """The scene with the rules of growth above."""
    if GROWTH:
        text = change(text, "relaxation", growth=f"'{GROWTH}'")
    if CONTROL:
        text = change(text, "relaxation", control=f"'{CONTROL}'")
    if CRITICAL:
        text = change(text, "material", critical=f"'{CRITICAL}'")
    return text


class Specimen:
    """A kind of specimen: its scene, where its crack ends, and K over the load.

    `end`: the text of `&crack to` for a length; `first`, `last`: the crack's length, and the largest
    of the cracks for the compliance [m]; `shape`: K/P [Pa m^0.5/N] of a length; `opening`: how often
    the loaded boundary's displacement counts (2 where another moves against it); `finer`: spacings
    of the fine lattice in one; `less`: the part of the displacement after which a crack there has
    grown by as many horizons; `missed`: why loads are known to miss the target but on the fine
    lattice, "" if they do not.
    """

    def __init__(self, name, scene, end, first, last, shape, opening, finer, less, missed=""):
        self.name, self.scene, self.end, self.first, self.last = name, scene, end, first, last
        self.shape, self.opening, self.finer, self.less, self.missed = shape, opening, finer, less, missed

    def cuts(self, fine):
        """Lengths for the compliance [m], over a growth of as many horizons on either lattice. Whole
        spacings: a crack that ends between two columns of bonds is as long as one that ends at either.
        """
        return self.first + SPACING / (self.finer if fine else 1) * np.round(
            np.linspace(0.0, (self.last - self.first) / SPACING, 8))

    def refined(self, text):
        """The scene on the fine lattice; what guides the crack stays so many rows wide."""
        numbers = re.search(r"^  points = (.*)$", text, re.M).group(1)
        text = change(text, "body", points=", ".join(str(self.finer * int(n)) for n in numbers.split(",")))
        text = text.replace("0.0016", f"{0.0016 / self.finer:.6g}")
        return re.sub(r"^(  displacement_y = )(.*)$", lambda m: f"{m[1]}{self.less * float(m[2]):.6g}",
                      text, flags=re.M)


def compact(a):
    """ASTM E399, W = 50 mm."""
    width = 0.05
    r = a / width
    f = (2 + r) * (0.886 + 4.64 * r - 13.32 * r**2 + 14.72 * r**3 - 5.6 * r**4) / (1 - r)**1.5
    return f / (THICKNESS * np.sqrt(width))


def bent(a):
    """ASTM E399, span 4 W, W = 40 mm."""
    width = 0.04
    r = a / width
    f = 3 * np.sqrt(r) * (1.99 - r * (1 - r) * (2.15 - 3.93 * r + 2.7 * r**2)) / (
        2 * (1 + 2 * r) * (1 - r)**1.5)
    return 4 * f / (THICKNESS * np.sqrt(width))


def cantilever(a):
    """Beams with a rotation at their root, h = 15 mm."""
    height = 0.015
    return a / (THICKNESS * height**1.5) * (3.46 + 2.38 * height / a)


SPECIMENS = {
    "compact": Specimen("compact tension", "compact_tension.nml", lambda a: f"{a:.6g}, 0.0",
                        0.025, 0.043, compact, 2, 2, 0.74),
    "bent": Specimen("three-point bending", "bent_beam.nml", lambda a: f"0.0, {a:.6g}",
                     0.016, 0.034, bent, 1, 2, 0.64),
    "cantilever": Specimen("double cantilever", "double_cantilever.nml", lambda a: f"{a:.6g}, 0.0",
                           0.040, 0.058, cantilever, 2, 4, 0.505,
                           "the stress along its crack, at a horizon of a tenth of an arm: README.md"),
    "cantilever_90": Specimen("double cantilever", "double_cantilever.nml", lambda a: f"{a:.6g}, 0.0",
                              0.040, 0.0586, cantilever, 2, 3, 0.60, "see cantilever"),
}


def material(text, nu, plane):
    """The scene with another Poisson's ratio and plane."""
    text = change(text, "scene", plane=f"'{plane}'")
    return change(text, "material", poissons_ratio=nu)


def compliance(case, kind, text, label, fine=False):
    """Lengths [m] and compliances [m/N] of the elastic specimen with cracks cut at these lengths."""
    found = []
    dx = None
    cuts = kind.cuts(fine)
    for number, a in enumerate(cuts):
        cut = change(text, "crack", to=kind.end(a))
        cut = change(cut, "material", critical_energy_release_rate=1e12)
        cut = change(cut, "relaxation", load_steps=1, tolerance=1e-5)
        results = case.run(f"{label}_cut{number}.nml", cut, threads=case.threads)
        dx = spacing_of(results)
        side = results.boundary("loaded")
        found.append(kind.opening * abs(side.displacement_y[-1]) / abs(side.reaction_y[-1]))
    return cuts + dx / 2, np.array(found), dx


def formula(kind, lengths, values, modulus):
    """K of the elastic bodies, by G = P^2/(2 B) dC/da, over the closed form; at the fourth cut."""
    slope = values[3] * CubicSpline(lengths, np.log(values))(lengths[3], 1)
    return np.sqrt(slope / (2 * THICKNESS) * modulus) / kind.shape(lengths[3])


def grow(case, kind, nu=0.35, plane="stress", fine=False, label=""):
    """Let the crack of a specimen grow. Returns a dictionary: the load over P_c(a) averaged over the
    growth from 3 to 10 horizons, the peak load over P_c of the initial crack, the energy per area over
    Gc in the same growth, how far the crack came in horizons, and the curves.
    """
    text = material(case.scene(kind.scene), nu, plane)
    if fine:
        text = kind.refined(text)
    label = label or kind.scene[:-4]
    lengths, values, dx = compliance(case, kind, text, label, fine)
    results = case.run(f"{label}_grown.nml", with_rules(text), threads=case.threads)
    h, side = results.history, results.boundary("loaded")
    load = np.abs(np.asarray(side.reaction_y))
    opening = kind.opening * np.abs(np.asarray(side.displacement_y))
    loaded = load > 1e-3 * load.max()
    load, opening = load[loaded], opening[loaded]
    # Lengths beyond the cuts are not known
    dense = np.linspace(lengths[0], lengths[-1], 4001)
    curve = np.exp(CubicSpline(lengths, np.log(values))(dense))
    a = np.interp(opening / load, curve, dense, right=np.nan)
    toughness = np.sqrt(TOUGHNESS * (YOUNG if plane == "stress" else YOUNG / (1 - nu**2)))
    over = load * kind.shape(a) / toughness
    delta = 3.015 * dx
    growth = (a - lengths[0]) / delta
    spent = (np.asarray(h["external_work"]) - np.asarray(h["strain_energy"]))[loaded]
    inside = np.flatnonzero((growth >= 3) & (growth <= 10))
    answer = dict(peak=load.max() * kind.shape(lengths[0]) / toughness, reach=np.nanmax(growth),
                  mean=np.nan, energy=np.nan, dissipated=np.nan, growth=growth, over=over,
                  results=results)
    if len(inside) > 1:
        # Over the length, not over rows, which need not be equally far apart
        first, last = inside[0], inside[-1]
        place, value = a[first:last + 1], over[first:last + 1]
        order = np.argsort(place)
        place, value = place[order], value[order]
        answer["mean"] = np.sum((value[1:] + value[:-1]) / 2 * np.diff(place)) / (place[-1] - place[0])
        answer["energy"] = (spent[last] - spent[first]) / (
            THICKNESS * (a[last] - a[first])) / TOUGHNESS
        answer["dissipated"] = float(np.diff(np.asarray(h["dissipated_energy"])[loaded][[first, last]])[0]
                                     / (THICKNESS * (a[last] - a[first])) / TOUGHNESS)
    answer["formula"] = formula(kind, lengths, values,
                                YOUNG if plane == "stress" else YOUNG / (1 - nu**2))
    return answer


def judge(case, kind, fine=False, **settings):
    """A specimen's rows."""
    found = grow(case, kind, fine=fine, **settings)
    where = kind.name
    if "nu" in settings:
        where += f", nu {settings['nu']:.2g}, plane {settings['plane']}"
    if fine:
        where += {2: ", half the spacing", 3: ", a third of the spacing",
                  4: ", a quarter of the spacing"}[kind.finer]
    for what, value in ((f"{where}: mean P/P_c(a), growth of 3 to 10 horizons", found["mean"]),
                        ("   energy per area over Gc in the same growth", found["energy"])):
        if kind.missed and not fine:
            case.not_met(what, value, 1.0, abs(value - 1) <= 0.05, kind.missed)
        else:
            case.near(what, value, 1.0, relative=0.05)
    case.above("   growth reached, in horizons", found["reach"], 10.0)
    case.show("   peak load over P_c of the cut crack", found["peak"], 1.0)
    case.show("   what bonds held when they broke, per area over Gc", found["dissipated"])
    case.show("   K from the compliance over the closed form", found["formula"], 1.0)
    case.curves[where] = (found["growth"], found["over"])
    return found


def specimen(name):
    """A part of the suite."""
    def part(case):
        kind = SPECIMENS[name]
        if case.options.quick and name == "bent":
            # Its elastic bodies take longer than all the rest
            return []
        if case.options.quick:
            text = case.scene(kind.scene)
            lengths, values, _ = compliance(case, kind, text, kind.scene[:-4])
            case.near(f"{kind.name}: K from the compliance over the closed form",
                      formula(kind, lengths, values, YOUNG), 1.0, relative=0.05)
            return []
        pictures = [(judge(case, kind)["results"], "damage", kind.name)]
        if case.options.full and GROWTH == "events":
            judge(case, kind, fine=True, label=f"{kind.scene[:-4]}_fine")
        return pictures
    return part


def materials(name, fine=False):
    """A part of the suite: a specimen of six materials, on the fine lattice if it takes that."""
    def part(case):
        kind = SPECIMENS[name]
        for nu in (0.2, 1 / 3, 0.4):
            for plane in ("stress", "strain"):
                judge(case, kind, fine=fine or bool(kind.missed), nu=nu, plane=plane,
                      label=f"{name}{'_fine' * fine}_{nu:.2f}_{plane}".replace("0.", ""))
        return []
    return part
