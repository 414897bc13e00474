#!/usr/bin/env python3
"""Kill a writing program at random moments and see that no complete output is lost.

    check_kill.py [--times N] [--seed S] NAME.vtkhdf COMMAND ...

COMMAND writes NAME.vtkhdf, each time anew over what is there (perifort run ... --overwrite, or
mpirun with it). It runs once undisturbed; then it is started N times (30) and ended with SIGKILL,
with all processes that it has started, in any order. Every other time it
finds no results, else those of the time before. Whatever file there is afterwards must open, and
all it counts as complete must equal the undisturbed run's.
"""
import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

from check_vtk import check_hdf, check_list, check_series


def read(path):
    """All complete outputs and history rows of a results file."""
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        steps = int(root["Steps"].attrs["NSteps"])
        count = steps * len(root["Points"])
        rows = int(file["history"].attrs["rows"])
        found = {"Points": root["Points"][:], "Values": root["Steps/Values"][:steps]}
        found.update({f"PointData/{name}": data[:count]
                      for name, data in root["PointData"].items()})
        found.update({f"history/{name}": data[:rows] for name, data in file["history"].items()})
        found.update({f"points/{name}": data[:] for name, data in file["points"].items()})
        return steps, rows, found


def same_beginning(part, whole, what):
    """Whether all of `part` is the beginning of `whole`."""
    assert part.keys() == whole.keys(), f"{what}: other datasets"
    for name, values in part.items():
        assert np.array_equal(values, whole[name][:len(values)],
                              equal_nan=True), f"{what}: {name} differs"


def check_table(path, reference, what):
    """All complete lines of the history table equal the undisturbed run's."""
    if not path.exists():
        return
    lines = path.read_text().split("\n")[:-1]
    assert lines == reference[:len(lines)], f"{what}: {path.name} differs"


def below(process):
    """The processes that a process has started, and those that these have started."""
    found = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            found += [int(word) for word in task.read_text().split()]
        except OSError:
            continue
    return found + [other for one in found for other in below(one)]


def kill(program, chance):
    """End a program and all that it has started, and wait until they are gone."""
    processes = below(program.pid) + [program.pid]
    chance.shuffle(processes)
    for process in processes:
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            continue
    program.wait()
    limit = time.monotonic() + 10
    while any(is_alive(process) for process in processes) and time.monotonic() < limit:
        time.sleep(0.01)


def is_alive(process):
    """Whether a process is there and not only waits to be counted by its parent."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def main():
    """Run, kill, compare."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("file", type=Path)
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    path, folder = options.file, options.file.parent
    series, listing = path.with_suffix(".pvd"), path.with_suffix(".xdmf")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    shutil.rmtree(folder, ignore_errors=True)
    start = time.monotonic()
    subprocess.run(options.command, check=True, stdout=subprocess.DEVNULL)
    duration = time.monotonic() - start
    all_steps, all_rows, whole = read(path)
    table = (folder / "history.csv").read_text().split("\n")
    assert all_steps > 1, "the command writes too little to be interrupted"

    moments = random.Random(options.seed)
    cut_short, none_yet, unlisted = set(), 0, 0
    for number in range(1, options.times + 1):
        fresh = number % 2 == 1
        if fresh:
            shutil.rmtree(folder)
        older = path.exists()
        program = subprocess.Popen(options.command, **quiet)
        time.sleep(moments.uniform(0.0, 1.02 * duration))
        kill(program, moments)
        what = f"kill {number}"
        if not path.exists():
            assert not older, f"{what}: older results are gone and there are no new ones"
            folder.mkdir(parents=True, exist_ok=True)
            none_yet += 1
            continue
        steps, rows, part = read(path)
        same_beginning(part, whole, what)
        check_table(folder / "history.csv", table, what)
        if steps > 0:
            check_hdf(path, partial=True)
        if listing.exists():
            check_list(listing, path, partial=True)
        else:
            # the list comes after the first output; an older one goes before the older outputs
            assert steps <= 1 or older, f"{what}: no {listing.name} with {steps} outputs"
            unlisted += 1
        if series.exists():
            check_series(series, partial=True)
        if steps < all_steps:
            cut_short.add(steps)
        print(f"{what}: {steps} of {all_steps} outputs, {rows} of {all_rows} rows, all intact")
    print(f"{options.times} kills, {none_yet} before the first output, {unlisted} before the list of "
          f"outputs, "
          f"{len(cut_short)} different stages of a file")
    if not cut_short:
        sys.exit("no kill met a file under way: the test shows nothing; write more or kill more "
                 "often")


if __name__ == "__main__":
    main()
