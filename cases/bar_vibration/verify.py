"""Longitudinal vibration of a bar against the analytic solution: the book's bar, the six horizons
of figure 7.6 and the four spacings of figure 7.8. --quick leaves out the finest spacing."""
import numpy as np
from common import Case, Results, change, wave
from discrete import Lattice, vibration

LENGTH, MODULUS, DENSITY, STRAIN, AREA = 1.0, 200e9, 7850.0, 1e-3, 1e-6
SPEED = np.sqrt(MODULUS / DENSITY)
STEP, STEPS = 1.94598e-7, 26000     # of the book's bar: L/1000, horizon 3.015 spacings


def variant(case, ratio, count):
    """The base scene with another horizon (in spacings) and number of points: its text and its
    step.

    The book's rule for the step, 0.8 sqrt(2 rho dx/(V_h c)), makes it proportional to dx and to the
    square root of the ratio; the time computed stays that of the book's bar.
    """
    step = STEP * (1000 / count) * np.sqrt(ratio / 3.015)
    steps = round(STEPS * STEP / step)
    scene = change(case.scene("bar.nml"), "body", points=count)
    scene = change(scene, "time", step=f"{step:.9e}", steps=steps)
    scene = change(scene, "output", every=steps, history_every=max(1, steps // 26000))
    scene = change(scene, "probe", point=LENGTH / 2 - LENGTH / count / 2)
    end = scene.index("&time")
    return scene[:end] + f"&horizon\n  ratio = {ratio}\n/\n\n" + scene[end:]


def centre(results: Results):
    """Times, displacements of the point at the centre, and the exact ones."""
    t, u = results.history["time"], results.history["centre_displacement_x"]
    x = results.points[results.nearest([LENGTH / 2 - 1e-9]), 0]
    return t, u, wave(x, t, STRAIN, LENGTH, SPEED)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def discrete_centre(results, ratio, count):
    """The exact answer of the discrete system, found through its modes, on the rows of the
    history.
    """
    spacing = LENGTH / count
    points = results.points[:, :1]
    lattice = Lattice(points, spacing, ratio * spacing, MODULUS, section=AREA)
    held = points[:, 0] < 0
    start = np.where(held, 0.0, STRAIN * points[:, 0])
    step = results.history["time"][-1] / results.history["step"][-1]
    return vibration(lattice, held, DENSITY, start, step,
                     results.nearest([LENGTH / 2 - 1e-9]), results.history["step"])


def panels(path, runs, names):
    """The figure: displacement of the centre over time, a panel for every run."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    rows = (len(runs) + 1) // 2
    figure, axes = plt.subplots(rows, 2, figsize=(10, 2.3 * rows), sharex=True, sharey=True)
    for axis, results, name in zip(axes.flat, runs, names):
        t, u, exact = centre(results)
        axis.plot(1e3 * t, 1e3 * exact, color="0.65", linewidth=2.5, label="analytic")
        axis.plot(1e3 * t, 1e3 * u, color="tab:red", linewidth=0.8, label="peridynamic")
        axis.set_title(name, fontsize=10)
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("time [ms]")
    for axis in axes[:, 0]:
        axis.set_ylabel("u [mm]")
    axes.flat[0].legend(fontsize=8, loc="upper right")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    plt.close(figure)
    print(f"  wrote {path}")


def main():
    case = Case(__file__, __doc__)
    bar = case.run("bar.nml", threads=1)
    t, u, exact = centre(bar)
    case.equal("rows of the history", len(t), STEPS + 1)
    # a regression: 6.24e-6 m was measured
    case.below("book's bar: rms of u(centre) - analytic, regression [m]", rms(u - exact), 6.5e-6)
    terms = np.arange(4000)[:, None]
    some = t[::2000]
    wavenumber = (2 * terms + 1) * np.pi / 2 / LENGTH
    series = 8 * STRAIN * LENGTH / np.pi**2 * np.sum(
        (-1.0)**terms / (2 * terms + 1)**2 * np.sin(wavenumber * 0.4995)
        * np.cos(wavenumber * SPEED * some), axis=0)
    case.below("the series of 4000 terms against its closed form [m]",
               np.abs(series - wave(0.4995, some, STRAIN, LENGTH, SPEED)).max(), 1e-7)
    # The rule of the steps keeps an energy that differs by dt^2 rho a^2/8; at the start, when the
    # force at the free end drops to 0 over one horizon, that is of the order of (c dt)^2/(delta L)
    # of the whole
    case.below("book's bar: gap of the energy balance", bar.balance(),
               (SPEED * STEP)**2 / (3.015e-3 * LENGTH))

    # Figure 7.6
    ratios = (1.015, 3.015, 5.015, 10.015, 25.015, 50.015)
    by_horizon, errors = [], []
    for ratio in ratios:
        name = f"horizon_{int(ratio)}"
        results = case.run(f"{name}.nml", variant(case, ratio, 1000), threads=1)
        t, u, exact = centre(results)
        errors.append(rms(u - exact))
        by_horizon.append(results)
        case.show(f"figure 7.6, delta = {int(ratio):2d} dx: rms error [m]", errors[-1])
        case.below("   largest distance from the discrete solution [m]",
                   np.abs(u - discrete_centre(results, ratio, 1000)).max(), 1e-10)
    case.equal("figure 7.6: errors of delta = dx and 3 dx are the two smallest",
               sorted(np.argsort(errors)[:2].tolist()), [0, 1])
    case.equal("figure 7.6: from 3 dx on the error grows with the horizon",
               bool(np.all(np.diff(errors[1:]) > 0)), True)

    # Figure 7.8
    counts = (10, 100, 1000) if case.options.quick else (10, 100, 1000, 10000)
    by_spacing, errors = [], []
    for count in counts:
        results = by_horizon[1] if count == 1000 else case.run(
            f"points_{count}.nml", variant(case, 3.015, count), threads=1)
        t, u, exact = centre(results)
        errors.append(rms(u - exact))
        by_spacing.append(results)
        case.show(f"figure 7.8, dx = L/{count}: rms error [m]", errors[-1])
        if count < 1000:
            case.below("   largest distance from the discrete solution [m]",
                       np.abs(u - discrete_centre(results, 3.015, count)).max(), 1e-10)
        if count == 10:
            quarter = len(t) // 4
            case.above("   error of the last quarter of the time over that of the first",
                       rms((u - exact)[-quarter:]) / rms((u - exact)[:quarter]), 1.5)
    case.equal("figure 7.8: the error falls with the spacing", bool(np.all(np.diff(errors) < 0)),
               True)

    if case.options.pictures:
        panels(case.folder / "horizons.png", by_horizon,
               [f"$\\delta = {int(r)}\\,\\Delta$" for r in ratios])
        if not case.options.quick:
            panels(case.folder / "spacings.png", by_spacing, [f"$\\Delta = L/{c}$" for c in counts])
    case.finish()


main()
