"""A cantilever in a CAD surface, as a lattice and as a mesh, beside each other and beside the beam of
Timoshenko.
"""
import os
import subprocess

import numpy as np
from common import change
from make_surface import BEAM_LONG, BEAM_WIDTH, THICK

MODULUS, NU, FORCE = 200e9, 0.25, 100.0
LONG, WIDTH, HIGH = 1e-3 * BEAM_LONG, 1e-3 * BEAM_WIDTH, 1e-3 * THICK
# The part that is one thickness away from both ends, over which what is not that of a beam falls by
# e^-4.2 (the slowest term of Saint-Venant's problem in the plane)
BEGIN, END = HIGH, LONG - HIGH


def theory(arm):
    """Of a beam with its load at x = `arm`: curvature in the middle [1/m], angle of shear [-], and
    deflection of the end of the part beyond the tangent of the sections at its begin [m], whole and
    from bending alone. The shear coefficient is Cowper's (1966), whose rotation is that of the plane
    nearest to a section.
    """
    inertia, area = WIDTH * HIGH**3 / 12, WIDTH * HIGH
    shear = 10 * (1 + NU) / (12 + 11 * NU) * MODULUS / (2 * (1 + NU)) * area
    long = END - BEGIN
    bent = -FORCE / (MODULUS * inertia) * ((arm - BEGIN) * long**2 / 2 - long**3 / 6)
    return (-FORCE * (arm - (BEGIN + END) / 2) / (MODULUS * inertia), -FORCE / shear,
            bent - FORCE / shear * long, bent)


def measured(results):
    """The same of the results: deflection and rotation of sections as polynomials of x, by least
    squares over the volume.
    """
    x, u, volume = results.points, results.field("displacement"), results.volume
    used = (x[:, 0] > BEGIN) & (x[:, 0] < END)
    weight = np.sqrt(volume[used])[:, None]
    along, height = x[used, 0] - (BEGIN + END) / 2, x[used, 2] - HIGH / 2
    powers = along[:, None] ** np.arange(4)
    down = np.linalg.lstsq(weight * powers, weight[:, 0] * u[used, 2], rcond=None)[0]
    # u_x = mean(x) - z rotation(x)
    terms = np.hstack([powers[:, :3], -height[:, None] * powers[:, :3]])
    turn = np.linalg.lstsq(weight * terms, weight[:, 0] * u[used, 0], rcond=None)[0][3:]
    half = (END - BEGIN) / 2
    deflection, rotation = np.polynomial.Polynomial(down), np.polynomial.Polynomial(turn)
    return (turn[1], down[1] - turn[0],
            deflection(half) - deflection(-half) - 2 * half * rotation(-half))


def three(case, size):
    """The results of the three with one spacing [mm]."""
    scene = case.scene("beam.nml")
    surface = case.run(f"beam_surface_{size}.nml", change(
        scene, "body", surface=f"'{case.folder}/beam.stl'", spacing=f"{size}e-3"))
    plain = scene
    for line in ("  surface = 'beam.stl'\n", "  scale = 1e-3\n", "  spacing = 1e-3\n"):
        plain = plain.replace(line, "")
    points = ", ".join(str(round(edge / (1e-3 * size))) for edge in (LONG, WIDTH, HIGH))
    lattice = change(plain, "body", lower="0.0, 0.0, 0.0", upper=f"{LONG}, {WIDTH}, {HIGH}",
                     points=points)
    lattice = lattice.replace("side = 'beam:wall'", "region = 'back'").replace(
        "side = 'beam:tip'", "side = 'x_max'")
    lattice += (f"&region\n  name = 'back'\n  shape = 'box'\n  upper(1) = {3.015e-3 * size}\n/\n")
    # Edges of 2 mm make points with a spacing of some 1.1 mm
    name = f"beam_{size}.msh"
    subprocess.run([os.environ["CASE_PYTHON"], str(case.folder / "make_mesh.py"),
                    str(case.out / name), str(2 * size), "0"], check=True)
    mesh = plain.replace("  name = 'beam'\n", f"  name = 'beam'\n  mesh = '{name}'\n  scale = 1e-3\n")
    return {"STL": surface, "lattice": case.run(f"beam_lattice_{size}.nml", lattice),
            "mesh": case.run(f"beam_mesh_{size}.nml", mesh)}


def judge_beam(case):
    """Ten and twenty points across: within 3 % of the beam, which is what the surfaces of bent
    strips of as many points leave with `surface_correction = 'energy'` (2.1 % in the case patch);
    the lattices beside each other within 0.1 %, since only how the load is spread differs (README).
    """
    errors = {}
    for size in (2.0, 1.0, 0.5):
        found = {}
        for name, results in three(case, size).items():
            # The outermost row of a lattice is half a spacing inside, facets are at the end
            arm = LONG - (0.5e-3 * size if name == "lattice" else 0.0)
            values = theory(arm)
            found[name] = curvature, angle, deflection = [
                a / b for a, b in zip(measured(results), values)]
            errors[name, size] = abs(deflection - 1)
            what = f"cantilever, {name}, {size} mm"
            case.show(f"{what}: angle of shear over that of a beam [-]", f"{angle:.3f}", 1)
            if size == 2.0:
                case.show(f"{what}: deflection over that of a beam [-]", f"{deflection:.3f}", 1)
                continue
            case.near(f"{what}: curvature over that of a beam [-]", curvature, 1.0, absolute=0.03)
            case.near(f"{what}: deflection over that of a beam [-]", deflection, 1.0, absolute=0.03)
            case.above(f"{what}: deflection over that of bending alone [-]",
                       deflection * values[2] / values[3], 1.05)
            case.near(f"{what}: force at the wall [N]", abs(results.history["wall_reaction_z"][-1]),
                      FORCE, relative=1e-3)
        if size < 2.0:
            for which, what in ((0, "curvature"), (2, "deflection")):
                case.near(f"cantilever, {size} mm: {what} of the lattice over that in the STL file "
                          "[-]", found["lattice"][which] / found["STL"][which], 1.0, absolute=1e-3)
                case.near(f"cantilever, {size} mm: {what} of the mesh over that in the STL file [-]",
                          found["mesh"][which] / found["STL"][which], 1.0, absolute=0.03)
    for name in ("STL", "lattice", "mesh"):
        case.above(f"cantilever, {name}: error of the deflection at 2 mm over that at 1 mm [-]",
                   errors[name, 2.0] / errors[name, 1.0], 2.0)
