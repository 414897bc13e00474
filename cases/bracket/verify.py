"""A bracket from a STL file, as a mesh and from shapes: volume, force at the wall, and the bending of
its arm beside that of a beam; a cantilever in the same three ways.
"""
import os
import subprocess
import sys

import numpy as np
from beam import judge_beam
from common import Case, change
from make_surface import THICK, WIDTH, LONG, area, profile

MODULUS, FORCE = 200e9, 100.0
# Points of the arm between the fillet and the end, one thickness away from both
BEGIN, END = 30e-3, 70e-3


def curvature(results):
    """The curvature of the arm in the middle of its part between fillet and end [1/m], from a cubic
    through the mean deflection of each row.
    """
    x, u = results.points, results.field("displacement")[:, 2]
    used = (x[:, 0] > BEGIN) & (x[:, 0] < END)
    fit = np.polynomial.Polynomial.fit(x[used, 0], u[used], 3)
    return fit.deriv(2)((BEGIN + END) / 2)


def main():
    case = Case(__file__, __doc__)
    if "CASE_PYTHON" not in os.environ:
        sys.exit("error: start this as ./pf verify bracket: CASE_PYTHON names no python with gmsh")
    volume = area(profile(24)) * WIDTH * 1e-9
    stiffness = MODULUS * WIDTH * 1e-3 * (THICK * 1e-3)**3 / 12
    beam = -FORCE * (LONG * 1e-3 - (BEGIN + END) / 2) / stiffness
    # The thickness is 5, 10 and 6.67 cells
    sizes = (2.0, 1.0, 1.5)
    bent, shown = {}, None
    for fill in ("centre", "volume"):
        for size in sizes:
            results = case.run(f"{fill}_{size}.nml", change(
                case.scene("bracket.nml"), "body", surface=f"'{case.folder}/bracket.stl'",
                spacing=f"{size}e-3", fill=f"'{fill}'"))
            if fill == "volume" or size != 1.5:
                case.near(f"fill = '{fill}', {size} mm: volume [m3]", results.volume.sum(), volume,
                          relative=1e-8 if fill == "volume" else 0.002)
            else:
                case.show(f"fill = '{fill}', {size} mm: volume [m3]",
                          f"{results.volume.sum():.4g}", f"{volume:.4g}")
            case.near(f"fill = '{fill}', {size} mm: force at the wall [N]",
                      abs(results.history["wall_reaction_z"][-1]), FORCE, relative=1e-3)
            if (fill, size) == ("centre", 1.0):
                shown = results
            bent[fill, size] = curvature(results) / beam
            case.show(f"fill = '{fill}', {size} mm: curvature of the arm over that of a beam",
                      f"{bent[fill, size]:.3f}", 1)
    for fill, size in (("centre", 1.0), ("volume", 1.0), ("volume", 1.5)):
        case.near(f"fill = '{fill}', {size} mm: curvature of the arm over that of a beam [-]",
                  bent[fill, size], 1.0, absolute=0.06 * size)
    case.below("fill = 'centre', 1 mm over 2 mm: error of the curvature [-]",
               (bent["centre", 1.0] - 1) / (bent["centre", 2.0] - 1), 0.5)
    three_ways(case, shown, bent["centre", 1.0], volume, beam)
    judge_beam(case)
    if case.options.pictures:
        picture(case, shown)
    case.finish()


def three_ways(case, surface, bent, volume, beam):
    """The lattice in the STL file, the same lattice from shapes, and a mesh of tetrahedra with about the
    same spacing: the same arm.
    """
    lattice = case.run("lattice.nml")
    case.equal("from shapes: points", len(lattice.points), len(surface.points))
    # The same points in the same order
    case.below("from shapes: distance of the points from those in the STL file [m]",
               np.abs(lattice.points - surface.points).max(), 1e-9)
    u, v = (results.field("displacement") for results in (lattice, surface))
    # The outermost row is half a spacing inside of the end, where facets have their moment: the arm
    # of the force is 0.5 mm of 70 mm shorter, and the end of a beam 3/2 of that less deflected
    case.below("from shapes: difference of displacements over the largest [-]",
               np.abs(u - v).max() / np.abs(v).max(), 1.1 * 1.5 * 0.5 / (LONG - THICK))
    subprocess.run([os.environ["CASE_PYTHON"], str(case.folder / "make_mesh.py"),
                    str(case.out / "bracket.msh"), "2"], check=True)
    text = case.scene("bracket.nml").replace("  surface = 'bracket.stl'\n", "").replace(
        "  spacing = 1e-3\n", "")
    mesh = case.run("mesh.nml", change(text, "body", mesh="'bracket.msh'"))
    case.show("mesh: points, and in the STL file", len(mesh.points), len(surface.points))
    case.near("mesh: volume [m3]", mesh.volume.sum(), volume, relative=1e-9)
    case.near("mesh: force at the wall [N]", abs(mesh.history["wall_reaction_z"][-1]), FORCE,
              relative=1e-3)
    case.near("mesh: curvature of the arm over that of a beam [-]", curvature(mesh) / beam, 1.0,
              absolute=0.06)
    case.near("mesh: curvature of the arm over that in the STL file [-]",
              curvature(mesh) / beam / bent, 1.0, absolute=0.03)
    ends = [results.field("displacement")[results.points[:, 0] > 79e-3, 2].mean()
            for results in (surface, mesh)]
    case.near("mesh: deflection of the end over that in the STL file [-]", ends[1] / ends[0], 1.0,
              absolute=0.03)


def picture(case, results):
    from perifort.pictures.layout import new_figure
    from plot import draw, save
    figure = new_figure(6.5, 4.5)
    draw(figure, (1, 1, 1), results, "stress_xx", -1, "100 N at the end of the arm", 500)
    save(figure, case.folder / "bracket.png")


if __name__ == "__main__":
    main()
