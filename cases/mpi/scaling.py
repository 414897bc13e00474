"""Scaling on ranks, measured on this machine: ./pf bench --ranks N [--points POINTS] [--repeats R].

A cube, state-based, with a lattice family, on 1 to N ranks with one thread each (strong: the same
cube; weak: as many cubes in a row as ranks), and on as many threads of one rank. Shown are the
medians of the repeats, which run in turn, and the bytes that ranks send in a step beside the
formula. A model of the cost is fitted to the runs and carried on to clusters by latency and
bandwidth of networks from the literature: these rows are extrapolations, not measurements.
"""
import argparse
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = os.environ.get("PERIFORT", "")
PARALLEL = os.environ.get("PERIFORT_MPI", "")
RATIO = 3.015
REACH = 3                # cells that a halo is thick, at this ratio
STEPS = 40
UNITS = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
CORES_OF_A_NODE = 64     # that share the connection of a node, in the extrapolation
# Latency of a message [s] and bandwidth of a node [bytes/s]
NETWORKS = [
    ("2005: 2 us, 1.5 GB/s", 2e-6, 1.5e9),     # Brightwell et al., Portals 3.3 on Red Storm
    ("2018: 1 us, 12.5 GB/s", 1e-6, 12.5e9),   # Panda, The MVAPICH2 Project, at SC18: InfiniBand
]
SCENE = """&scene dimension = 3 /
&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /
&body lower = 0, 0, 0 upper = {x}, 1, 1 points = {nx}, {n}, {n} /
&horizon ratio = {ratio} family = 'lattice' /
&region name = 'all' shape = 'box' lower = -1, -1, -1 upper = 1e3, 2, 2 /
&initial region = 'all' velocity_x = '10*sin(3*x + y)' /
&time steps = {steps} /
&output every = {steps} history_every = {steps} fields = 'displacement' /
"""


def bytes_of_step(dim, halo, steps):
    """What all ranks send in a step on average [bytes]: displacements of each copy and its
    dilatation, once for each step and once at the start.
    """
    return 8 * (dim + 1) * halo * (steps + 1) / steps


def scene(folder, n, cubes):
    path = Path(folder) / f"cube_{n}_{cubes}.nml"
    path.write_text(SCENE.format(x=cubes, nx=n * cubes, n=n, ratio=RATIO, steps=STEPS), encoding="utf-8")
    return path


def run(path, ranks, threads):
    """Seconds of a step, and bytes and messages of all ranks in it."""
    output = path.with_suffix("")
    shutil.rmtree(output, ignore_errors=True)
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OMPI_MCA_rmaps_base_oversubscribe="1",
                       OMPI_MCA_hwloc_base_binding_policy="none", OMPI_ALLOW_RUN_AS_ROOT="1",
                       OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMP_WAIT_POLICY="passive")
    if ranks >= (os.cpu_count() or 1):
        environment["OMPI_MCA_mpi_yield_when_idle"] = "1"
    start = [] if ranks == 1 else [os.environ.get("MPIRUN", "mpirun"), "-n", str(ranks)]
    program = PROGRAM if ranks == 1 else PARALLEL
    done = subprocess.run([*start, program, "run", str(path), "--output", str(output)],
                          env=environment, text=True, capture_output=True, check=False)
    if done.returncode:
        sys.exit(f"error: {path} on {ranks} ranks ended with status {done.returncode}:\n{done.stderr}")
    speed = re.search(r"speed .* ([\d.e+-]+) steps/s", done.stdout)
    sent = re.search(r"messages +([\d.e+-]+) (\w?)B in ([\d.e+-]+) messages a step", done.stdout)
    return (1 / float(speed.group(1)), float(sent.group(1)) * UNITS[sent.group(2)] if sent else 0.0,
            float(sent.group(3)) if sent else 0.0)


def halo_of(path, ranks):
    """Copies of all ranks, by the tree of cuts."""
    done = subprocess.run([PROGRAM, "check", str(path), "--ranks", str(ranks)], text=True,
                          capture_output=True, check=True)
    return sum(int(halo) for halo in re.findall(r"rank \d+: .* halo (\d+)", done.stdout))


def bonds_of(path):
    done = subprocess.run([PROGRAM, "check", str(path)], text=True, capture_output=True, check=True)
    return int(re.search(r"\((\d+) if both directions count\)", done.stdout).group(1))


def measure(rows, repeats):
    """Medians of all rows, whose repeats run in turn."""
    times = {row: [] for row in rows}
    for _ in range(repeats):
        for row in rows:
            times[row].append(run(*row))
    return {row: [statistics.median(column) for column in zip(*found)] for row, found in times.items()}


def model(points, cores, of_bond, of_copy, latency, bandwidth):
    """Seconds of a step and its efficiency, of cubes of points on so many cores, a rank each:
    bonds, copies whose bonds a rank computes too, two messages to each of 26 neighbours, two
    sums over all ranks.
    """
    side = (points / cores) ** (1 / 3)
    copies = (side + 2 * REACH) ** 3 - side ** 3 if cores > 1 else 0.0
    bonds = 122 * points / cores
    alone = bonds * of_bond
    messages = 2 * 26 * latency if cores > 1 else 0.0
    sent = bytes_of_step(3, copies, STEPS) * min(cores, CORES_OF_A_NODE) / bandwidth if cores > 1 else 0.0
    sums = 2 * latency * math.ceil(math.log2(cores)) if cores > 1 else 0.0
    step = alone + copies * of_copy + messages + sent + sums
    return step, alone / step


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, required=True, help="the most ranks that are measured")
    parser.add_argument("--points", type=int, default=60, help="points along an edge of a cube (default: 60)")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each row (default: 5)")
    options = parser.parse_args()
    for name, path in (("PERIFORT", PROGRAM), ("PERIFORT_MPI", PARALLEL)):
        if not Path(path).is_file():
            sys.exit(f"error: {name} does not name the program; start this as ./pf bench --ranks N")
    if options.ranks < 2 or options.points < 8 or options.repeats < 1:
        sys.exit("error: expected --ranks of 2 or more, --points of 8 or more, --repeats of 1 or more")
    with tempfile.TemporaryDirectory() as folder:
        show(folder, options)


def show(folder, options):
    n, most = options.points, options.ranks
    strong = scene(folder, n, 1)
    numbers = [p for p in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64) if p <= most]
    if most not in numbers:
        numbers.append(most)
    weak = {p: scene(folder, n, p) for p in numbers}
    rows = [(strong, 1, 1)] + [(strong, 1, p) for p in numbers] + [(strong, p, 1) for p in numbers] \
        + [(path, p, 1) for p, path in weak.items()]
    found = measure(rows, options.repeats)
    alone = found[strong, 1, 1][0]
    of_bond = alone / bonds_of(strong)
    print(f"A cube of {n}^3 points, state-based, {STEPS} steps, medians of {options.repeats} runs in turn, "
          f"{os.cpu_count()} cores\n")
    print("| what | ranks | threads | ms a step | efficiency | bytes a step | formula | messages |")
    print("|---|---|---|---|---|---|---|---|")
    off = 0.0
    for path, ranks, threads in rows:
        seconds, sent, messages = found[path, ranks, threads]
        cubes = 1 if path == strong else ranks
        ideal = alone * cubes / (ranks * threads)
        formula = bytes_of_step(3, halo_of(path, ranks), STEPS) if ranks > 1 else 0.0
        if ranks > 1:
            off = max(off, abs(sent / formula - 1))
        print(f"| {'strong' if path == strong else 'weak'} | {ranks} | {threads} | {seconds*1e3:.2f} | "
              f"{ideal/seconds:.2f} | {sent:.0f} | {formula:.0f} | {messages:.1f} |", flush=True)
    # What a copy costs beside its bytes: what ranks with a core each take longer than as many threads, which share
    # the memory, too; at least half of its bonds, which the rank computes
    costs = [(found[strong, p, 1][0] - found[strong, 1, p][0]) / (halo_of(strong, p) / p)
             for p in numbers if p <= (os.cpu_count() or 1)]
    of_copy = max([122 / 2 * of_bond, *costs])
    print(f"\nbond: {of_bond*1e9:.2f} ns; copy: {of_copy*1e9:.0f} ns a step")
    print(f"\nExtrapolation, not measured: efficiency of cubes on clusters by that, a rank on each core, "
          f"{CORES_OF_A_NODE} cores to a node, for networks of\n")
    print("| points | cores | " + " | ".join(name for name, _, _ in NETWORKS) + " |")
    print("|---|---|" + "---|" * len(NETWORKS))
    for points in (1e7, 1e8, 1e9, 1e10, 1e11):
        for cores in (1e2, 1e3, 1e4, 1e5):
            if points / cores < 1000:
                continue
            shares = [model(points, cores, of_bond, of_copy, latency, bandwidth)[1]
                      for _, latency, bandwidth in NETWORKS]
            print(f"| {points:.0e} | {cores:.0e} | " + " | ".join(f"{share:.2f}" for share in shares) + " |")
    if off > 1e-3:
        sys.exit(f"error: the bytes that ranks have sent differ from the formula by {100*off:.1f} %")


if __name__ == "__main__":
    main()
