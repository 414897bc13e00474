"""Fracture beside closed forms and experiments: loads, energies, speeds, angles, and the waves that
carry them. --full: all materials, finer grids, orders of convergence; --quick: coarse grids.
--only NAME[,NAME..]: some of the parts (see PARTS)."""
import sys
from pathlib import Path

from common import Case

sys.path.insert(0, str(Path(__file__).resolve().parent))
import bodies  # noqa: E402
import dynamics  # noqa: E402
import specimens  # noqa: E402
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
}


def main():
    case = Case(__file__, __doc__, options=(
        ("--full", dict(action="store_true", help="all materials, finer grids, orders (an hour)")),
        ("--only", dict(metavar="NAME", default="", help="some parts: " + ", ".join(PARTS))),
        ("--threads", dict(type=int, default=0, help="threads of the larger runs"))))
    case.threads = case.options.threads
    # Load over growth of the specimens, for a picture
    case.curves = {}
    names = case.options.only.split(",") if case.options.only else list(PARTS)
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        sys.exit(f"error: no part is called {', '.join(unknown)}; known: {', '.join(PARTS)}")
    for name in names:
        PARTS[name](case)
    case.finish()


main()
