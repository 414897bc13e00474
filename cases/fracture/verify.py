"""Fracture beside closed forms and experiments: loads, energies, speeds, angles, and the waves that
carry them. --full: six materials, finer grids, orders of convergence; --quick: coarse grids.
--only NAME[,NAME..]: some of the parts (see PARTS)."""
import sys
from pathlib import Path

from common import Case

sys.path.insert(0, str(Path(__file__).resolve().parent))
import bodies  # noqa: E402
import dynamics  # noqa: E402
import specimens  # noqa: E402
import sweep  # noqa: E402
import waves  # noqa: E402

PARTS = {
    "stress_intensity": waves.stress_intensity,
    "dispersion": waves.dispersion,
    "rayleigh": waves.rayleigh,
    "torsion": waves.torsion,
    "compact": specimens.specimen("compact"),
    "bent": specimens.specimen("bent"),
    "cantilever": specimens.specimen("cantilever"),
    "brazilian": bodies.brazilian,
    "l_panel": bodies.l_panel,
    "glass": dynamics.glass,
    "terminal": dynamics.terminal,
    "strip": dynamics.strip,
    "kalthoff": dynamics.kalthoff,
    "ring": dynamics.ring,
    "compact_materials": specimens.materials("compact"),
    "bent_materials": specimens.materials("bent"),
    "compact_materials_fine": specimens.materials("compact", fine=True),
    "bent_materials_fine": specimens.materials("bent", fine=True),
    "cantilever_materials": specimens.materials("cantilever"),
    "cantilever_materials_90": specimens.materials("cantilever_90"),
    "sweep": sweep.sweep,
}
# Parts that --full runs beside those before, and parts of an hour and more that only --only runs
LONG = ("compact_materials", "bent_materials")
APART = ("compact_materials_fine", "bent_materials_fine", "cantilever_materials",
         "cantilever_materials_90", "sweep")


def pictures(case, shown):
    """Fields that the parts returned, growth of the specimens, and sizes of the ring's pieces."""
    from perifort.pictures.layout import new_figure
    from plot import figure_of_fields, save
    for name in ("glass", "kalthoff", "brazilian", "l_panel"):
        if shown.get(name):
            items = shown[name] + (shown.get("terminal") or [] if name == "glass" else [])
            figure_of_fields(items, case.folder / f"{name}.png", width=5.0, dpi=80)
    if case.curves:
        figure = new_figure(6.0, 3.6)
        axes = figure.subplots()
        for label, (growth, over) in case.curves.items():
            axes.plot(growth, over, "o-", markersize=2.5, linewidth=0.8, label=label)
        axes.axhspan(0.95, 1.05, color="0.9")
        axes.axvspan(3, 10, color="0.5", alpha=0.1)
        axes.set(xlabel="growth, in horizons", ylabel="load over that of LEFM", xlim=(0, 12),
                 ylim=(0, 2))
        axes.legend(fontsize=7)
        save(figure, case.folder / "growth.png")
    if getattr(case, "ring", None):
        rates, sizes, grady = case.ring
        figure = new_figure(5.0, 3.4)
        axes = figure.subplots()
        axes.loglog(rates, sizes, "o-", label="perifort")
        axes.loglog(rates, grady, "--", color="0.5", label="Grady")
        axes.set(xlabel="rate [1/s]", ylabel="mean size of the pieces [m]")
        axes.legend(fontsize=7)
        save(figure, case.folder / "pieces.png")


def main():
    case = Case(__file__, __doc__, options=(
        ("--full", dict(action="store_true", help="materials, finer grids, orders (an hour)")),
        ("--only", dict(metavar="NAME", default="", help="some parts: " + ", ".join(PARTS))),
        ("--threads", dict(type=int, default=0, help="threads of the larger runs"))))
    case.threads = case.options.threads
    # Load over growth of the specimens, for a picture
    case.curves = {}
    names = [name for name in PARTS if name not in APART and (case.options.full or name not in LONG)]
    if case.options.only:
        names = case.options.only.split(",")
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        sys.exit(f"error: no part is called {', '.join(unknown)}; known: {', '.join(PARTS)}")
    shown = {name: PARTS[name](case) for name in names}
    if case.options.pictures:
        pictures(case, shown)
    case.finish()


main()
