"""The largest stable time step: measured, beside equation 7.25, and kept for 100,000 steps."""
import re
import subprocess
import sys

from common import Case, change

SPACING = 0.01
# points, Poisson's ratio, true limit over 7.25 (with surface factors, horizon 3.015 spacings, linear
# volume correction, surface correction by energy), computed apart from the program with sparse
# matrices and an eigenvalue solver. A chain in space has no dilatation at nu = 1/4
BODIES = {"bar": ([100], 0.3, 1.191), "plate": ([30, 20], 0.3, 1.722),
          "block": ([14, 12, 12], 0.3, 2.236), "soft_block": ([14, 12, 12], 0.45, 2.825),
          "chain_in_space": ([100, 1, 1], 0.25, 1.191), "bar_in_space": ([20, 2, 2], 0.3, 1.468),
          "sheet_in_space": ([12, 12, 2], 0.3, 1.713)}


def body(case, points, nu):
    """The plate's scene with another body of the same spacing."""
    text = case.scene("plate.nml")
    text = change(text, "scene", dimension=len(points))
    text = change(text, "material", poissons_ratio=nu)
    if len(points) == 1:
        # Poisson's ratio means nothing in 1D
        text = re.sub(r"^\s*poissons_ratio.*\n", "", text, flags=re.M)
    numbers = lambda values: ", ".join(f"{value:g}" for value in values)
    return change(text, "body", lower=numbers([0.0] * len(points)), points=numbers(points),
                  upper=numbers([count * SPACING for count in points]))


def limits(case, name, text):
    """The last three numbers that `perifort limits` prints."""
    case.out.mkdir(parents=True, exist_ok=True)
    path = case.out / f"{name}.nml"
    path.write_text(text, encoding="utf-8")
    seconds = "1" if case.options.quick else "5"
    done = subprocess.run([case.program, "limits", str(path), "--seconds", seconds, "--threads",
                           "1"], check=False, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"error: perifort limits ended with status {done.returncode} on {path}\n"
                 f"{done.stderr}")
    (case.out / f"{name}.txt").write_text(done.stdout, encoding="utf-8")
    last = dict(line.split(" = ") for line in done.stdout.splitlines()[-3:])
    return [float(last[key]) for key in ("step_equation_7_25", "step_spectral", "ratio")]


def total(results):
    """Kinetic and strain energy over the history [J]."""
    return results.history["kinetic_energy"] + results.history["strain_energy"]


def main():
    case = Case(__file__, __doc__)
    for name, (points, nu, ratio) in BODIES.items():
        text = body(case, points, nu)
        equation, spectral, measured = limits(case, name, text)
        case.near(f"{name}: largest stable step over 7.25 [-]", measured, ratio, relative=0.02)
        case.near(f"{name}: the ratio is that of the steps [-]", spectral / equation, measured,
                  relative=1e-4)
        steps = 10_000 if case.options.quick else 100_000
        results = case.run(f"{name}.nml", change(text, "time", steps=steps), threads=1)
        case.near(f"{name}: step of the run over the measured one [-]",
                  results.history["time"][-1] / steps / spectral, 0.95, relative=0.01)
        # Forward differences swing the energy of an oscillator by up to 1/(1 - 0.95^2)-fold; most
        # of the motion has lower frequencies
        energy = total(results)
        case.below(f"{name}: largest energy of {steps} steps over that of the start [-]",
                   energy.max() / energy[0], 2.0)
        half = len(energy) // 2
        case.near(f"{name}: mean energy, second half over first [-]",
                  energy[half:].mean() / energy[:half].mean(), 1.0, relative=0.01)

    results = case.run("breaking.nml", threads=1)
    h = results.history
    case.above("breaking: largest damage [-]", results.field("damage").max(), 0.5)
    gained = (total(results) + h["dissipated_energy"] - h["external_work"]) / total(results)[0]
    # The balance closes at second order in the step, here to 1.1 %; an unstable step would multiply
    # the energy without end
    case.near("breaking: energy at the end over that of the start [-]", gained[-1], 1.0,
              relative=0.03)
    case.near("breaking: energy, end over half time [-]", gained[-1] / gained[len(gained) // 2], 1.0,
              relative=0.002)
    case.finish()


main()
