#!/usr/bin/env python3
"""Scenes that nobody meant to write go through `check`, a sample of them through `run`.

Every mutant (mutations.py) must end within 10 seconds, in one of these ways:

  status 0   the scene is computed; every number in its results is finite
  status 3   there is no valid answer; the message names the step or iteration
  status 1   the message names the place: ` --> FILE:LINE`, the file alone where it holds no group
             or cannot be read, or ` --> FOLDER` for what cannot be written

A run that still computes after some seconds is asked to stop (SIGTERM) and must then end in order,
with status 4. No process may write a file outside its output folder.
"""
import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

import h5py
import numpy as np

from mutations import SCENE, bases, keys, mutant

LIMIT = 20.0         # seconds that a process may take
PATIENCE = 8.0       # seconds after which a run is asked to stop; a build with checks sets up in 3
MEMORY = 4 << 30     # bytes of address space
SHOWN = 20           # failures that are described


def limit_memory():
    """No process may take the whole machine. The limits of this one are those of all it starts: setting
    them for each would make starting it several times as slow."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def call(program, words, folder):
    """Status, seconds, whether it was asked to stop, and what was said."""
    begin = time.monotonic()
    process = subprocess.Popen([program, *words], cwd=folder, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    asked = False
    try:
        out, err = process.communicate(timeout=PATIENCE if words[0] == "run" else LIMIT)
    except subprocess.TimeoutExpired:
        asked = words[0] == "run"
        process.send_signal(signal.SIGTERM if asked else signal.SIGKILL)
        try:
            out, err = process.communicate(timeout=LIMIT - PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
    return (process.returncode, time.monotonic() - begin, asked,
            out.decode("utf-8", "replace"), err.decode("utf-8", "replace"))


def fault_of_message(message, files):
    """What is wrong with the message of an error of the input; '' if it names the place."""
    if not message.startswith("error: "):
        return "no message that begins with 'error: '"
    place = re.search(r"^ --> (\S.*?)(?::(\d+))?$", message, re.M)
    if not place:
        # What cannot be read at all is named as a whole
        return "" if message.startswith("error: the file '") else "the message names no place"
    data = files.get(place[1])
    if place[2] and data is not None and int(place[2]) > len(re.split(b"\r\n|\r|\n", data)):
        return "the message names a line that the file has not"
    return ""


def fault_of_results(folder):
    """What is wrong with the numbers of a run; '' if all are finite."""
    for path in folder.glob("*.vtkhdf"):
        with h5py.File(path, "r") as file:
            names = []
            file.visititems(lambda name, item: names.append(name)
                            if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" else None)
            outputs = int(file["VTKHDF/Steps"].attrs["NSteps"])
            rows = int(file["history"].attrs["rows"])
            points = len(file["VTKHDF/Points"])
            for name in names:
                length = (rows if name.startswith("history/") else
                          outputs * points if "PointData" in name else None)
                if not np.isfinite(file[name][:length]).all():
                    return f"{name} holds numbers that are not finite"
    return ""


def judge(words, answer, files, folder):
    """What is wrong with how the program ended; '' if nothing is."""
    status, seconds, asked, out, err = answer
    if status < 0:
        if seconds >= PATIENCE:
            return f"hangs: killed after {seconds:.1f} s"
        return f"crashes with signal {-status}"
    if seconds > LIMIT:
        return f"takes {seconds:.1f} s"
    if asked and status not in (0, 1, 3, 4):
        return f"ends with status {status} when it is asked to stop"
    if status == 4:
        return "" if asked else "status 4 though nobody asked"
    if status == 1:
        return fault_of_message(err, files)
    if status == 3 and not re.search(r"step \d+|iteration \d+|iterations", err):
        return "no step or iteration in the message of status 3"
    if status not in (0, 3):
        return f"status {status}"
    if status == 3 and words[0] == "check":
        return "status 3 of check"
    if words[0] == "run":
        return fault_of_results(folder / "results")
    return ""


def try_one(program, word, files, folder):
    """One scene through one command, in a folder of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    words = [word, SCENE, "--threads", "1"]
    if word == "run":
        words += ["--output", "results", "--overwrite", "--quiet"]
    answer = call(program, words, folder)
    fault = judge(words, answer, files, folder)
    allowed = {*files, "results"}
    strange = [path.name for path in folder.iterdir() if path.name not in allowed]
    if strange and not fault:
        fault = f"writes {strange} outside of its folder"
    return fault, answer


def main():
    """Make mutants, try them, count."""
    parser = argparse.ArgumentParser(prog="./pf verify bad_input", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=100000, help="mutants (100000)")
    parser.add_argument("--every", type=int, default=50, help="of which each so many-th runs (50)")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--program", default=os.environ.get("PERIFORT", ""))
    parser.add_argument("--run-program", help="another build of the program for the runs")
    parser.add_argument("--folder", default="out/bad_input")
    options = parser.parse_args()
    limit_memory()
    program = str(Path(options.program).resolve())
    if not Path(program).is_file():
        sys.exit("error: start this as ./pf verify bad_input: PERIFORT does not name the program")
    programs = {"check": program, "run": str(Path(options.run_program or program).resolve())}
    project = Path(__file__).resolve().parents[2]
    top = Path(options.folder).resolve()
    scenes, known = bases(program, project), keys(program)
    begin = time.monotonic()
    folders = Queue()
    for job in range(options.jobs):
        folders.put(top / f"job-{job}")
    for name, files in scenes.items():
        for word in ("check", "run"):
            fault, answer = try_one(programs[word], word, files, top / "base")
            if fault or answer[0] != 0:
                sys.exit(f"error: {word} of the untouched scene '{name}': status {answer[0]} {fault}"
                         f"\n{answer[4]}")

    def one(number):
        name, done, files = mutant(scenes, known, options.seed, number)
        folder = folders.get()
        try:
            results = []
            for word in ["check"] + (["run"] if number % options.every == 0 else []):
                results.append((number, word, name, done,
                                *try_one(programs[word], word, files, folder)))
            kept = top / "failed" / str(number)
            if any(result[4] for result in results):
                shutil.rmtree(kept, ignore_errors=True)
                kept.mkdir(parents=True)
                for file, data in files.items():
                    (kept / file).write_bytes(data)
            return results
        finally:
            folders.put(folder)

    shutil.rmtree(top / "failed", ignore_errors=True)
    ends, failed, slowest, tried = {}, 0, 0.0, 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for results in pool.map(one, range(options.first, options.first + options.number),
                                chunksize=1):
            for number, word, name, done, fault, answer in results:
                tried += 1
                slowest = max(slowest, answer[1])
                ends[word, answer[0]] = ends.get((word, answer[0]), 0) + 1
                if not fault:
                    continue
                failed += 1
                if failed <= SHOWN:
                    print(f"mutant {number} ({name}: {done}), {word}: {fault}\n"
                          f"{answer[4][:600]}", flush=True)
    for (word, status), count in sorted(ends.items()):
        print(f"{word:5} status {status:3}: {count}")
    print(f"bad_input: {tried} calls on {options.number} mutants of {len(scenes)} scenes, "
          f"{failed} failed; the slowest took {slowest:.1f} s, all {time.monotonic() - begin:.0f} s")
    if failed:
        print(f"the scenes that failed are in {top / 'failed'}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
