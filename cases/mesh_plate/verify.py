"""A meshed plate under tension, and a strip with a hole: its stress concentration on meshes of
several sizes; the book's plate, meshed.
"""
import numpy as np
from book import book_plates, make_mesh
from common import Case, change

MODULUS, NU, PULL, RADIUS = 200e9, 0.3, 1e6, 5e-3
CENTRE = np.array([0.05, 0.025])
# Howland's strip, over the stress of the whole section, at a hole of a fifth of its width
HOWLAND = 3.14


def concentration(results, local=False):
    """The stress at the hole's side over the mean stress of the whole section, by the terms of
    Kirsch's solution, 1, (a/r)^2 and (a/r)^4, from points on the line across that are a horizon
    or more away from the hole: nearer ones are softer. With `local` horizons that of the points at
    the hole.
    """
    x, stress = results.points[:, :2] - CENTRE, results.field("stress_xx")
    spacing = np.sort(np.sqrt(results.volume / 1e-3))
    # The median by volume, as the program takes it
    horizon = 2.015 * spacing[np.searchsorted(np.cumsum(spacing**2), np.sum(spacing**2) / 2)]
    r = np.hypot(*x.T)
    if local:
        horizon = 2.015 * np.sqrt(np.median(results.volume[r < 1.2 * RADIUS]) / 1e-3)
    used = (np.abs(x[:, 0]) < 0.6e-3) & (r > RADIUS + horizon) & (r < 3 * RADIUS)
    return np.polyval(np.polyfit((RADIUS / r[used])**2, stress[used] / PULL, 2), 1.0), \
        horizon / RADIUS


def main():
    case = Case(__file__, __doc__)
    results = case.run("plate.nml")
    u, x, volume = results.field("displacement"), results.points, results.volume
    inner = np.all(np.abs(x[:, :2] - 0.025) < 0.0125, axis=1)
    for c, target, tolerance in ((0, PULL / MODULUS, 0.03), (1, -NU * PULL / MODULUS, 0.08)):
        case.near(f"plate: strain along {'xy'[c]} inside [-]",
                  np.polyfit(x[inner, c], u[inner, c], 1)[0], target, relative=tolerance)
    case.near("plate: mean stress of all points over the pull [-]",
              np.sum(volume * results.field("stress_xx")) / volume.sum() / PULL, 1.0,
              relative=0.05)
    case.near("plate: volume [m3]", volume.sum(), 0.05 * 0.05 * 1e-3, relative=1e-12)
    values = {2.0: concentration(case.run("hole.nml"))}
    own = {2.0: concentration(case.run("local_2.0.nml", change(
        case.scene("hole.nml"), "horizon", local=".true.").replace(
            "'hole.msh'", f"'{case.folder}/hole.msh'")), True)}
    for size in (1.0,) if case.options.quick else (1.0, 0.7, 0.5):
        name = f"hole_{size}"
        make_mesh(case, f"{name}.msh", size)
        values[size] = concentration(case.run(f"{name}.nml", change(
            case.scene("hole.nml"), "body", mesh=f"'{name}.msh'")))
        own[size] = concentration(case.run(f"local_{size}.nml", change(change(
            case.scene("hole.nml"), "body", mesh=f"'{name}.msh'"), "horizon", local=".true.")), True)
    for size, (value, horizon) in values.items():
        case.show(f"hole: K_t with elements of {size} mm, horizon/radius {horizon:.3f} [-]",
                  f"{value:.3f}", HOWLAND)
    for size, (value, horizon) in own.items():
        case.show(f"hole: K_t with elements of {size} mm and local horizons, {horizon:.3f} at the hole"
                  " [-]", f"{value:.3f}", HOWLAND)
    case.near("hole: K_t with local horizons, mean of all meshes [-]",
              np.mean([value for value, _ in own.values()]), HOWLAND, relative=0.03)
    errors = [abs(value / HOWLAND - 1) for value, _ in values.values()]
    case.above("hole: error of the coarsest mesh over that of the finest [-]",
               errors[0] / errors[-1], 2.0)
    if not case.options.quick:
        case.near("hole: K_t on the finest mesh [-]", values[0.5][0], HOWLAND, relative=0.03)
    book_plates(case)
    case.finish()


if __name__ == "__main__":
    main()
