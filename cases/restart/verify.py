"""Runs that are killed at random moments and started again: nothing finished is lost, and the end
is that of a run in one piece, bit for bit.

    --kills N    so many kills (50)
    --seed N     of the moments (1)
"""
import argparse
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

FOLDER = Path(__file__).resolve().parent
# A run is killed several times over before it may come to its end
CHAIN = 5


def read(path):
    """All complete outputs and rows of a results file, and what doesn't change."""
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        outputs, rows = int(root["Steps"].attrs["NSteps"]), int(file["history"].attrs["rows"])
        count = outputs * len(root["Points"])
        found = {"Points": root["Points"][:], "times": root["Steps/Values"][:outputs]}
        found.update({f"PointData/{k}": v[:count] for k, v in root["PointData"].items()})
        found.update({f"history/{k}": v[:rows] for k, v in file["history"].items()})
        found.update({f"points/{k}": v[:] for k, v in file["points"].items()})
        found["scene"] = np.frombuffer(file["scene/text"][()], np.uint8)
    return outputs, found


def same_bits(part, whole):
    """Whether all arrays of one are the beginning of those of the other; '' or the first that
    isn't."""
    if part.keys() != whole.keys():
        return "names"
    for name, values in part.items():
        if values.tobytes() != whole[name][:len(values)].tobytes():
            return name
    return ""


class Subject:
    """A scene, its results in one piece, and a folder in which its runs are killed."""

    def __init__(self, program, out, name):
        self.scene, self.name = FOLDER / f"{name}.nml", name
        self.program = program
        self.whole, self.folder, self.aside = (out / f"{name}_{k}"
                                               for k in ("whole", "killed", "aside"))
        for folder in (self.whole, self.folder, self.aside):
            shutil.rmtree(folder, ignore_errors=True)
        begin = time.monotonic()
        subprocess.run(self.command(self.whole, 1, "--overwrite"), check=True,
                       stderr=subprocess.DEVNULL)
        self.duration = time.monotonic() - begin
        self.outputs, self.reference = read(self.file(self.whole))
        self.table = (self.whole / "history.csv").read_text()
        rises = np.count_nonzero(np.diff(self.reference["history/broken_bonds"]) > 0)
        assert name == "rest" or rises >= 2, f"{name}: no crack grows"

    def command(self, folder, threads, *words):
        """The command of a run."""
        return [self.program, "run", str(self.scene), "--output", str(folder), "--threads",
                str(threads), "--quiet", *words]

    def file(self, folder):
        """The results file in a folder."""
        return folder / f"{self.name}.vtkhdf"

    def start(self, folder, threads):
        """Start or go on, as a line in a queue's script does."""
        return subprocess.Popen(self.command(folder, threads, "--restart"),
                                stderr=subprocess.PIPE, text=True)

    def check_part(self, folder):
        """What a kill has left: number of complete outputs, or -1 before the first, and what is
        wrong."""
        path = self.file(folder)
        if not path.exists():
            return -1, ""
        outputs, part = read(path)
        fault = same_bits(part, self.reference)
        table = folder / "history.csv"
        if not fault and table.exists():
            lines = table.read_text().split("\n")[:-1]
            if lines != self.table.split("\n")[:len(lines)]:
                fault = "history.csv"
        series = folder / f"{self.name}.pvd"
        for member in re.findall(r'file="([^"]*)"', series.read_text()) if series.exists() else []:
            if (folder / member).read_bytes() != (self.whole / member).read_bytes():
                fault = fault or member
        return outputs, fault

    def check_amid(self, folder):
        """Whether a run of one load step was stopped amid it: '' or where it stopped."""
        first, last = self.reference["history/step"][[0, -1]]
        step = float((folder / "iterations.csv").read_text().split("\n")[-2].split(",")[0])
        return "" if first < step < last else f"stopped at iteration {step:.0f} of {last:.0f}"

    def check_end(self, folder):
        """Whether a folder holds the results of the run in one piece: '' or what differs."""
        outputs, found = read(self.file(folder))
        fault = same_bits(found, self.reference)
        if outputs != self.outputs or len(found["history/step"]) != len(
                self.reference["history/step"]):
            fault = fault or "number of outputs or rows"
        tables = (path for kind in ("*.csv", "*.vtu", "*.pvd", "*.xdmf")
                  for path in self.whole.glob(kind))
        for path in tables:
            if (folder / path.name).read_bytes() != path.read_bytes():
                fault = fault or path.name
        if sorted(p.name for p in folder.iterdir()) != sorted(
                p.name for p in self.whole.iterdir()):
            fault = fault or "names of files"
        return fault


def kill_and_go_on(subject, moments, kills, tally):
    """Kill one run up to CHAIN times; after each kill let a copy of it go on to its end."""
    shutil.rmtree(subject.folder, ignore_errors=True)
    for _ in range(min(CHAIN, kills)):
        run = subject.start(subject.folder, moments.choice((1, 2)))
        time.sleep(moments.uniform(0.0, 0.9 * subject.duration))
        run.kill()
        run.communicate()
        tally["kills"] += 1
        outputs, fault = subject.check_part(subject.folder)
        newest = (subject.folder / f"{subject.name}.checkpoint").exists()
        shutil.rmtree(subject.aside, ignore_errors=True)
        if subject.folder.exists():
            shutil.copytree(subject.folder, subject.aside)
        run = subject.start(subject.aside, moments.choice((1, 2)))
        message = run.communicate()[1]
        if run.returncode != 0:
            fault = fault or f"status {run.returncode}: {message}"
        fault = fault or subject.check_end(subject.aside)
        tally["faults"] += bool(fault)
        tally["from a checkpoint"] += newest
        tally["stages"].add((subject.name, outputs))
        print(f"  kill {tally['kills']}: {subject.name}, {outputs} of {subject.outputs} outputs, "
              f"{'a' if newest else 'no'} checkpoint: "
              f"{'FAIL, ' + fault if fault else 'intact, and the same end'}", flush=True)
        if not (subject.folder / f"{subject.name}.unfinished").exists() and outputs > 0:
            break


def stop_and_go_on(subject, what, tally, words=(), number=None):
    """Stop a run in order and type the command that it prints."""
    wait = 0.5 * subject.duration
    while True:
        shutil.rmtree(subject.folder, ignore_errors=True)
        run = subprocess.Popen(subject.command(subject.folder, 1, *words), stderr=subprocess.PIPE,
                               text=True)
        if number is not None:
            time.sleep(wait)
            run.send_signal(number)
        message = run.communicate()[1]
        # A run that was over before the signal came is faster than the one that was timed
        if run.returncode != 0 or number is None or wait < 0.02 * subject.duration:
            break
        wait /= 2
    printed = re.search(r"to go on: (.*)", message)
    fault = ""
    if run.returncode != 4 or not printed:
        fault = f"status {run.returncode}: {message}"
    elif subject.name == "rest":
        fault = subject.check_amid(subject.folder)
    while not fault and run.returncode == 4:
        run = subprocess.run(shlex.split(printed.group(1)),
                             stderr=subprocess.PIPE, text=True, check=False)
        if run.returncode not in (0, 4):
            fault = f"status {run.returncode}: {run.stderr}"
    fault = fault or subject.check_end(subject.folder)
    tally["faults"] += bool(fault)
    print(f"  {subject.name}, {what}: {'FAIL, ' + fault if fault else 'status 4, the same end'}",
          flush=True)


def main():
    """Kill, go on, compare."""
    parser = argparse.ArgumentParser(prog="./pf verify restart", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="ten kills")
    options = parser.parse_args()
    kills = 10 if options.quick else options.kills
    program = os.environ.get("PERIFORT", "")
    if not Path(program).is_file():
        sys.exit("error: start this as ./pf verify restart: PERIFORT does not name the program")
    begin = time.time()
    out = Path("out") / FOLDER.name
    out.mkdir(parents=True, exist_ok=True)
    moments = random.Random(options.seed)
    print(f"restart: results go to {out}", flush=True)
    subjects = [Subject(program, out, name) for name in ("crack", "relaxation", "rest")]
    tally = {"kills": 0, "faults": 0, "from a checkpoint": 0, "stages": set()}
    for subject in subjects:
        for what, number in (("SIGINT", signal.SIGINT), ("SIGTERM", signal.SIGTERM),
                             ("SIGUSR1", signal.SIGUSR1)):
            stop_and_go_on(subject, what, tally, number=number)
        minutes = f"{0.4 * subject.duration / 60:.5f}"
        stop_and_go_on(subject, "--max-minutes", tally, ("--max-minutes", minutes))
    turn = 0
    while tally["kills"] < kills:
        kill_and_go_on(subjects[turn % 3], moments, kills - tally["kills"], tally)
        turn += 1
    print(f"\nrestart: {tally['kills']} kills at {len(tally['stages'])} different stages, "
          f"{tally['from a checkpoint']} after a checkpoint, and 12 orderly stops: "
          f"{tally['faults']} faults in {time.time() - begin:.0f} s")
    sys.exit(1 if tally["faults"] else 0)


if __name__ == "__main__":
    main()
