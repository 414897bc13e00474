#!/usr/bin/env python3
"""What the disk does to a run: full, a limit on the size of files, forbidden, taken away.

    check_disk.py PROGRAM SCENE.nml FOLDER

SCENE is small and writes often. Each time the status must be 1, the message must name the file and
the reason, and what was written before must open. A full disk is a tmpfs of some kilobytes, which
needs root to be mounted; a folder where nothing may be written needs another user, which root
becomes.
"""
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py

from check_vtk import check_list

failures = []


def run(program, scene, folder, *words, user=None, limit=None):
    """Status and message of a run into `folder`, as another user or with a limit on file sizes."""
    def before():
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    done = subprocess.run([program, "run", str(scene), "--output", str(folder), "--quiet",
                           "--threads", "1", *words], check=False, capture_output=True, text=True,
                          user=user, preexec_fn=before if user is None else None)
    return done.returncode, done.stderr


def expect(what, answer, *parts):
    """The status is 1, and the message has these parts."""
    status, message = answer
    missing = [part for part in parts if part not in message]
    good = status == 1 and message.startswith("error: ") and not missing
    print(f"{'pass' if good else 'FAIL'}  {what}: status {status}, {message.strip()[:150]}")
    if not good:
        failures.append(what)


def outputs(path):
    """Complete outputs of a results file; it must open, and all of them must be readable."""
    with h5py.File(path, "r") as file:
        number = int(file["VTKHDF/Steps"].attrs["NSteps"])
        points = len(file["VTKHDF/Points"])
        for data in file["VTKHDF/PointData"].values():
            assert len(data[:number * points]) == number * points, f"{path} is too short"
        rows = int(file["history"].attrs["rows"])
        assert all(len(column[:rows]) == rows for column in file["history"].values())
    check_list(path.with_suffix(".xdmf"), path, partial=True)
    return number


def judge(what, good):
    """Note what is not as it should be."""
    print(f"{'pass' if good else 'FAIL'}  {what}")
    if not good:
        failures.append(what)


def full_disk(program, scene, top):
    """A tmpfs with room for some outputs: those are there, and older results survive."""
    disk = top / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1500k", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(command, check=False, capture_output=True).returncode:
        print("skip  full disk: only root can mount a small one")
        return
    try:
        name = f"{scene.stem}.vtkhdf"
        expect("the disk gets full", run(program, scene, disk / "r"), "No space left", name)
        first = outputs(disk / "r" / name)
        judge(f"{first} outputs were complete before", first > 0)
        # What remains is taken away, too: there is no room for a new layout
        try:
            with open(disk / "rest", "wb", buffering=0) as rest:
                while True:
                    rest.write(b" " * 4096)
        except OSError:
            pass
        expect("the disk is full", run(program, scene, disk / "r", "--overwrite"), "No space left")
        judge("the older results are as they were", outputs(disk / "r" / name) == first)
        judge("nothing is left behind", not list((disk / "r").glob("*.part")))
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def main():
    """Try them all."""
    program, scene, top = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]).resolve()
    shutil.rmtree(top, ignore_errors=True)
    top.mkdir(parents=True)
    name = f"{scene.stem}.vtkhdf"
    full_disk(program, scene, top)

    # Places for all outputs are set aside at once: a limit shows before the first
    status, _ = run(program, scene, top / "older")
    judge("a run without limits", status == 0)
    whole = outputs(top / "older" / name)
    expect("a limit on file sizes", run(program, scene, top / "older", "--overwrite", limit=20000),
           name)
    judge("the older results are as they were", outputs(top / "older" / name) == whole)
    expect("a limit without older results", run(program, scene, top / "limit", limit=250000), name)
    judge("nothing is left behind", not list((top / "limit").glob("*")))

    closed = top / "closed"
    closed.mkdir()
    closed.chmod(0o555)
    if os.geteuid() != 0:
        expect("a folder without permission", run(program, scene, closed / "r"), str(closed / "r"),
               "Permission denied")
    else:
        # Another user must be able to get there, and to read the program and the scene
        there = Path("/tmp") / f"perifort-closed-{os.getpid()}"
        shutil.rmtree(there, ignore_errors=True)
        (there / "closed").mkdir(parents=True)
        there.chmod(0o755)
        shutil.copy(program, there / "perifort")
        shutil.copy(scene, there / "scene.nml")
        (there / "closed").chmod(0o555)
        expect("a folder without permission", run(str(there / "perifort"), there / "scene.nml",
                                                  there / "closed" / "r", user=65534),
               "closed/r", "Permission denied")
        shutil.rmtree(there)
    expect("a file in the folder's place", run(program, scene, scene), str(scene))
    expect("a folder below a file", run(program, scene, scene / "r"), str(scene))

    # Many more steps than can be done before the folder is gone
    long = top / "long.nml"
    long.write_text(scene.read_text().replace("steps = 400", "steps = 400000"))
    gone = top / "gone"
    process = subprocess.Popen([program, "run", str(long), "--output", str(gone), "--quiet",
                                "--threads", "1"], stderr=subprocess.PIPE, text=True)
    while not (gone / "long.vtkhdf").exists() and process.poll() is None:
        time.sleep(0.02)
    shutil.rmtree(gone, ignore_errors=True)
    shutil.rmtree(gone, ignore_errors=True)
    try:
        _, message = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        process.kill()
        message = "goes on for a minute"
    expect("the folder is taken away", (process.returncode, message), "gone")

    print(f"{len(failures)} failed")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
