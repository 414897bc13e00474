"""Random scenes in static equilibrium against a sparse direct solution of the same discrete equations.

Bodies of the plane in one or two materials whose stiffness differs by up to a million, up to fifty
times as long as thick, with and without cracks, held at one end or at two, loaded along and across,
and carried along by their supports by up to their length. Strains are small, so that the equations
are linear to far below the tolerance. Every scene is solved with both solvers at the default
tolerance. Reactions must be within 1e-3 of the largest net force, displacements (less those that the
whole body has in common) within 1e-3 of the largest. How often dynamic relaxation needs the conjugate
gradient solver after its 100,000 iterations is counted.
"""
import subprocess
import sys
from collections import Counter

import numpy as np

from common import Case, Results
from discrete import Lattice

SPACING = 0.01
HORIZON = 3.015 * SPACING
THICKNESS = 0.02


class Scene:
    """One random scene: its text for the program, and its answer from a direct solution."""

    def __init__(self, number):
        random = np.random.default_rng(number)
        rows = int(random.integers(3, 7))
        columns = int(rows * 50 ** random.uniform(0.1, 1.0)) + 8
        columns = min(columns, 50 * rows)
        nx, ny = columns, rows
        x, y = np.meshgrid((np.arange(nx) + 0.5) * SPACING, (np.arange(ny) + 0.5) * SPACING)
        self.points = np.column_stack([x.ravel(), y.ravel()])
        contrast = 10 ** random.uniform(0, 6) if random.random() < 0.7 else 1.0
        lengthwise = random.random() < 0.7
        self.modulus = 2e11, 2e11 / contrast
        if random.random() < 0.5:
            self.modulus = self.modulus[::-1]
        ratio = (0.3, 0.2) if random.random() < 0.7 else (1 / 3, 1 / 3)
        split = int(nx * random.uniform(0.2, 0.8)) if lengthwise else (ny + 1) // 2
        length, height = nx * SPACING, ny * SPACING
        part = self.points[:, 0 if lengthwise else 1] > split * SPACING
        self.cut = []
        for _ in range(int(random.integers(0, 3))):
            at = (int(random.integers(3, nx - 3)) + 0.1) * SPACING
            self.cut.append(((at, -SPACING),
                             (at + 0.2 * SPACING, (ny - 2.6) * SPACING * random.uniform(0.2, 1))))
        lattice = Lattice(self.points, SPACING, HORIZON, np.where(part, *self.modulus[::-1]),
                          np.where(part, *ratio[::-1]), THICKNESS, self.cut)
        # supports: the first three columns, and often the last three
        foot = self.points[:, 0] < 3 * SPACING
        head = self.points[:, 0] > length - 3 * SPACING
        two = random.random() < 0.5
        held = np.repeat((foot | (head & two))[:, None], 2, axis=1)
        relative = random.normal(size=2) if two else np.zeros(2)
        load = np.zeros((len(self.points), 2))
        loaded = head if not two else (abs(self.points[:, 0] - length / 2) < 1.6 * SPACING)
        if not two or random.random() < 0.5:
            load[loaded] = random.normal(size=2) * 10 ** random.uniform(-2, 2, size=2)
        stretched = lattice.statics(0 * load, held, np.where(head[:, None], relative, 0.0))
        loose = lattice.statics(load, held)
        size = lambda u: max(abs(u).max(), 1e-300)
        amount = 3e-6 * height
        load *= amount / size(loose)
        relative = relative * amount / size(stretched)
        self.u = loose * amount / size(loose) + stretched * amount / size(stretched)
        force = lattice.apply(self.u.ravel()).reshape(self.u.shape) - load
        self.reactions = [lattice.volume * force[where].sum(axis=0) for where in
                          ([foot, head] if two else [foot])]
        self.largest = max([np.linalg.norm(r) for r in self.reactions]
                           + [np.linalg.norm(lattice.volume * load.sum(axis=0))])
        self.carried = (random.random() < 0.7) * random.normal(size=2)
        self.carried *= length * 10 ** random.uniform(-6, 0) / max(np.linalg.norm(self.carried), 1)
        to = lambda vector: ", ".join(f"{v:.17g}" for v in vector)
        upper = (split * SPACING, height) if lengthwise else (length, split * SPACING)
        lower = (split * SPACING, 0.0) if lengthwise else (0.0, split * SPACING)
        counts = ((split, ny), (nx - split, ny)) if lengthwise else ((nx, split), (nx, ny - split))
        groups = [f"&scene dimension=2 plane='stress' thickness={THICKNESS} /",
                  f"&body name='a' material='a' lower=0.0,0.0 upper={to(upper)} "
                  f"points={counts[0][0]},{counts[0][1]} /",
                  f"&body name='b' material='b' lower={to(lower)} upper={to((length, height))} "
                  f"points={counts[1][0]},{counts[1][1]} /"]
        for name, modulus, nu in zip("ab", self.modulus, ratio):
            groups.append(f"&material name='{name}' youngs_modulus={modulus:.17g} "
                          f"poissons_ratio={nu:.17g} /")
        edges = {"foot": (-1.0, 3 * SPACING), "head": (length - 3 * SPACING, length + 1.0),
                 "middle": (length / 2 - 1.6 * SPACING, length / 2 + 1.6 * SPACING)}
        for name, (low, high) in edges.items():
            groups.append(f"&region name='{name}' shape='box' lower(1)={low:.17g} "
                          f"upper(1)={high:.17g} /")
        for start, end in self.cut:
            groups.append(f"&crack from={to(start)} to={to(end)} /")
        for name, by in (("foot", self.carried), ("head", self.carried + relative))[:1 + two]:
            groups.append(f"&boundary region='{name}' name='{name}' displacement_x={by[0]:.17g} "
                          f"displacement_y={by[1]:.17g} /")
        if np.any(load):
            density = load[loaded][0]
            groups.append(f"&load region='{'middle' if two else 'head'}' "
                          f"body_force_x={density[0]:.17g} body_force_y={density[1]:.17g} /")
        groups += ["&time method='relaxation' /",
                   "&relaxation solver='SOLVER' /",
                   "&horizon ratio=3.015 dilatation='unprojected' /",
                   "&output fields='displacement' /"]
        self.text = "\n".join(groups) + "\n"
        self.about = (f"{nx} x {ny}, contrast {contrast:.0e} "
                      f"{'along' if lengthwise else 'across'}, {len(self.cut)} cracks, "
                      f"{'two ends' if two else 'one end'}, carried {np.linalg.norm(self.carried):.0e} m")

    def errors(self, results):
        """Of reactions and of displacements, as parts of the largest."""
        u = results.field("displacement")[:, :2]
        order = np.lexsort((self.points[:, 0].round(9), self.points[:, 1].round(9)))
        theirs = np.lexsort((results.points[:, 0].round(9), results.points[:, 1].round(9)))
        if abs(results.points[theirs, :2] - self.points[order]).max() > 1e-9:
            raise ValueError("the program has other points")
        displacement = abs(u[theirs] - self.carried - self.u[order]).max() / abs(self.u).max()
        reaction = 0.0
        for name, wanted in zip(("foot", "head"), self.reactions):
            got = np.array([results.history[f"{name}_reaction_{c}"][-1] for c in "xy"])
            reaction = max(reaction, np.linalg.norm(got - wanted) / self.largest)
        return reaction, displacement


def main():
    case = Case(__file__, __doc__)
    case.out.mkdir(parents=True, exist_ok=True)
    scenes = range(10 if case.options.quick else 40)
    worst, ends, helped = {}, {}, 0
    for solver in ("conjugate_gradient", "dynamic_relaxation"):
        ends[solver] = Counter()
        worst[solver] = [0.0, 0.0]
        for number in scenes:
            scene = Scene(number)
            path = case.out / f"scene_{number}.nml"
            path.write_text(scene.text.replace("SOLVER", solver), encoding="utf-8")
            output = case.out / f"scene_{number}_{solver}"
            run = subprocess.run([case.program, "run", str(path), "--output", str(output),
                                  "--overwrite", "--quiet", "--threads", "1"],
                                 capture_output=True, text=True, check=False)
            ends[solver][run.returncode] += 1
            if run.returncode == 3:
                print(f"  {number:2d} {solver}: no answer ({scene.about})")
                continue
            if run.returncode != 0:
                sys.exit(f"error: status {run.returncode} of scene {number}: {run.stderr}")
            results = Results(output)
            errors = scene.errors(results)
            told = output / "warnings.txt"
            helped += told.exists() and "goes on from there" in told.read_text(encoding="utf-8")
            worst[solver] = [max(pair) for pair in zip(worst[solver], errors)]
            print(f"  {number:2d} {solver}: {results.history['step'][-1]:.0f} iterations, reactions "
                  f"{errors[0]:.1e}, displacements {errors[1]:.1e} ({scene.about})", flush=True)
    for solver, (reaction, displacement) in worst.items():
        case.below(f"{solver}: error of reactions", reaction, 1e-3)
        case.below(f"{solver}: error of displacements", displacement, 1e-3)
        case.equal(f"{solver}: scenes without an answer", ends[solver][3], 0)
    case.show("dynamic_relaxation: scenes finished by conjugate gradients", float(helped))
    case.finish()


main()
