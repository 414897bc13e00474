"""What the studies of this folder show, asked of runs made now: which settings are better, not how
fast they are. --quick leaves out the long ones."""
import csv
import subprocess
import sys

from common import Case


def study(case, name):
    """Run a study; its rows by the values of their keys, as written, numbers as float."""
    print(f"  {name}: running ...", end=" ", flush=True)
    folder = case.out / name
    done = subprocess.run([case.program, "study", str(case.folder / f"{name}.nml"), "--output",
                           str(folder), "--overwrite", "--quiet", "--threads", "1"], check=False)
    if done.returncode != 0:
        sys.exit(f"error: perifort ended with status {done.returncode} on {name}.nml")
    print("done", flush=True)
    with open(folder / "study.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    keys = rows[0].index("error")
    return {tuple(row[:keys]): dict(zip(rows[0][keys:], map(float, row[keys:])))
            for row in rows[1:]}


def quick(case):
    """What the studies of a few seconds show."""
    runs = study(case, "surface")
    for points in ("40", "80", "160"):
        case.below(f"surface: error with the correction over that without, {points} points",
                   runs[points, "energy", "linear"]["error"]
                   / runs[points, "none", "linear"]["error"], 0.2)
    case.below("surface: without it and with 'linear' the error stays, 80 over 160 points",
               runs["80", "none", "linear"]["error"] / runs["160", "none", "linear"]["error"], 1.2)
    case.above("surface: with it the error falls, 80 over 160 points",
               runs["80", "energy", "linear"]["error"]
               / runs["160", "energy", "linear"]["error"], 1.8)

    # the stress is uniform: what is left is the tolerance of the solver, 1e-7 of the forces
    for rule in ("linear", "exact"):
        case.below(f"surface: largest error with consistent weights, '{rule}'",
                   max(runs[points, "consistent", rule]["error"] for points in ("20", "40", "80", "160")),
                   1e-5)

    runs = study(case, "volume")
    best = min(runs, key=lambda run: runs[run]["error"])
    case.equal("volume: the least error", ", ".join(best), "linear, 3.015, energy")
    without = {run: runs[run]["error"] for run in runs if run[1:] == ("3.015", "none")}
    case.equal("volume: the least at 3.015 without surface correction",
               min(without, key=without.get)[0], "exact")

    runs = study(case, "models")
    third = "0.333333333333333"
    for points in ("40", "160"):
        case.near(f"models: error at nu = 1/3, bond-based over state-based, {points} points",
                  runs["bond_based", third, points]["error"]
                  / runs["state_based", third, points]["error"], 1.0, relative=1e-6)

    runs = study(case, "integrators")
    for name, order in (("forward_backward", 2), ("adams_bashforth", 3), ("runge_kutta", 4)):
        case.near(f"integrators: error at safety 0.4 over 0.2, {name}",
                  runs[name, "0.4"]["error"] / runs[name, "0.2"]["error"], 2.0**order,
                  relative=0.25)


def long(case):
    """What the others show."""
    runs = study(case, "horizons")
    ratios = ("1.015", "3.015", "5.015", "10.015", "25.015", "50.015")
    errors = [runs[ratio, "1000"]["error"] for ratio in ratios]
    case.equal("horizons: the error grows with the horizon", errors == sorted(errors), True)
    case.near("horizons: the book's bar, regression [m]", errors[1], 6.23e-6, relative=0.02)

    runs = study(case, "spacings")
    for points in (10, 100, 1000):
        case.near(f"spacings: error with {points} points over that with ten times as many",
                  runs[f"{points}", "3.015"]["error"] / runs[f"{10 * points}", "3.015"]["error"],
                  10.0, relative=0.35)

    runs = study(case, "surface_block")
    for points in ("10", "20", "40", "80"):
        case.below(f"block: error with surface correction over that without, {points} points",
                   runs[points, "energy"]["error"] / runs[points, "none"]["error"], 0.2)

    case.below("block: largest error with consistent weights",
               max(runs[points, "consistent"]["error"] for points in ("10", "20", "40", "80")), 1e-5)

    runs = study(case, "dilatation")
    case.below("dilatation: difference of both, smallest steps",
               runs["unprojected", "0.025"]["error"], 1e-5)

    runs = study(case, "precision")
    case.below("precision: difference of both on the same points", runs["mixed", "160"]["error"],
               1e-5)

    for name, points, least in (("steps", "160", 1.6), ("steps_block", "20", 2.1)):
        runs = study(case, name)
        case.above(f"{name}: steps by 7.25 over spectral ones",
                   runs["equation", "0.95", points]["steps"]
                   / runs["spectral", "0.95", points]["steps"], least)
        if name == "steps":
            case.near("steps: error with spectral steps over that with 7.25",
                      runs["spectral", "0.95", points]["error"]
                      / runs["equation", "0.95", points]["error"], 1.0, relative=0.05)


def main():
    case = Case(__file__, __doc__)
    case.out.mkdir(parents=True, exist_ok=True)
    quick(case)
    if not case.options.quick:
        long(case)
    case.finish()


main()
