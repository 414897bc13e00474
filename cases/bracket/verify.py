"""A bracket from a STL file: volume, force at the wall, and the bending of its arm beside that of a
beam.
"""
import numpy as np
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
    volume = area(profile(24)) * WIDTH * 1e-9
    stiffness = MODULUS * WIDTH * 1e-3 * (THICK * 1e-3)**3 / 12
    beam = -FORCE * (LONG * 1e-3 - (BEGIN + END) / 2) / stiffness
    sizes = (2.0, 1.0)
    bent = {}
    for fill in ("centre", "volume"):
        for size in sizes:
            results = case.run(f"{fill}_{size}.nml", change(
                case.scene("bracket.nml"), "body", surface=f"'{case.folder}/bracket.stl'",
                spacing=f"{size}e-3", fill=f"'{fill}'"))
            case.near(f"fill = '{fill}', {size:.0f} mm: volume [m3]", results.volume.sum(), volume,
                      relative=1e-8 if fill == "volume" else 0.002 * size)
            case.near(f"fill = '{fill}', {size:.0f} mm: force at the wall [N]",
                      abs(results.history["wall_reaction_z"][-1]), FORCE, relative=1e-3)
            bent[fill, size] = curvature(results) / beam
            case.show(f"fill = '{fill}', {size:.0f} mm: curvature of the arm over that of a beam",
                      f"{bent[fill, size]:.3f}", 1)
    for fill in ("centre", "volume"):
        case.near(f"fill = '{fill}', 1 mm: curvature of the arm over that of a beam [-]",
                  bent[fill, 1.0], 1.0, absolute=0.1)
    case.finish()


if __name__ == "__main__":
    main()
