"""A bar held at one end and pulled with 200 MPa at the other, relaxed: u = sigma x/E."""
import numpy as np
from common import Case
from discrete import Lattice

MODULUS, STRESS, AREA, SPACING, RATIO = 200e9, 200e6, 1e-6, 1e-3, 3.015


def main():
    case = Case(__file__, __doc__)
    results = case.run("bar.nml", threads=1)
    points, u = results.points[:, :1], results.field("displacement")[:, 0]
    x = points[:, 0]
    body = results.layer == 0
    exact = STRESS * x / MODULUS
    middle, end = results.nearest([0.5005]), results.nearest([1.0])
    case.near("u in the middle [m]", u[middle], exact[middle], relative=0.002)
    case.near("u of the last point [m]", u[end], exact[end], relative=0.002)
    inner = (x > 0.1) & (x < 0.9)
    case.near("strain away from the ends [-]", np.polyfit(x[inner], u[inner], 1)[0],
              STRESS / MODULUS, relative=1e-6)
    case.near("reaction of the support [N]", results.history["support_reaction_x"][-1],
              -STRESS * AREA, relative=1e-6)
    # Clapeyron: the work of a dead load is twice the energy stored; the program counts the work of
    # slow loading, half the final force times the displacement
    case.near("strain energy over the work of the loads [-]",
              results.history["strain_energy"][-1] / results.history["external_work"][-1], 1.0,
              relative=1e-6)

    # In one dimension the equations are linear, so nothing but the relaxation's tolerance is left
    lattice = Lattice(points, SPACING, RATIO * SPACING, MODULUS, section=AREA)
    load = np.zeros_like(points)
    load[end] = STRESS / SPACING
    discrete = lattice.statics(load, held=~body[:, None])[:, 0]
    case.below("distance from the solution of the discrete equations, over the largest u [-]",
               np.abs(u - discrete).max() / np.abs(discrete).max(), 1e-6)

    if case.options.pictures:
        import matplotlib
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
        figure, axes = plt.subplots(1, 2, figsize=(10, 3.4))
        axes[0].plot(x[body], 1e3 * exact[body], color="0.65", linewidth=4, label="$\\sigma x/E$")
        axes[0].plot(x[body], 1e3 * u[body], color="tab:red", linewidth=1, label="peridynamic")
        axes[0].set(xlabel="x [m]", ylabel="u [mm]")
        axes[0].legend()
        axes[1].plot(x[body], 1e6 * (u - exact)[body], color="tab:red", linewidth=1)
        axes[1].set(xlabel="x [m]", ylabel="u $-$ $\\sigma x/E$ [$\\mu$m]")
        for axis in axes:
            axis.grid(alpha=0.3)
        figure.tight_layout()
        figure.savefig(case.folder / "bar.png", dpi=80)
        print(f"  wrote {case.folder / 'bar.png'}")
    case.finish()


main()
