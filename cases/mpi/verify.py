"""Runs on several ranks against the run on one: the same bits with --reproducible, the same numbers
within rounding without; errors, signals and killed ranks end all of them.

Scenes are small versions of other cases'. With --short those of continuous integration run, on three
ranks.
"""
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

import scaling
import scenes
from common import Case, change

PARALLEL = os.environ.get("PERIFORT_MPI", "")
ONE = ("--reproducible",)

# A scene of another case, its changed keys by group, and groups that are left out.
SCENES = [
    ("bar", "bar_vibration/bar.nml",
     {"body": {"points": "300"}, "time": {"step": "6.0e-7", "steps": "400"},
      "output": {"every": "100", "history_every": "10"}}),
    ("bending", "patch/bending.nml", {"horizon": {"surface_correction": "'energy'"}}),
    ("block", "block_tension/state_based.nml", {"body": {"points": "80, 8, 8"}}),
    ("plate", "plate_tension/state_based.nml", {"body": {"points": "60, 30"}}),
    ("hole", "plate_hole/elastic.nml",
     {"body": {"points": "60, 60"}, "relaxation": {"solver": "'dynamic_relaxation'",
                                                   "tolerance": "1.0e-6"}}),
    ("failure", "plate_hole/failure.nml",
     {"body": {"points": "50, 50"}, "relaxation": {"load_steps": "20"}, "output": {"every": "5"}}),
    ("crack", "plate_crack/slow.nml",
     {"body": {"points": "120, 120"}, "time": {"step": "5.0e-8", "steps": "400"},
      "output": {"every": "100"}}),
    ("glass", "fracture/glass.nml",
     {"body": {"points": "100, 40"}, "time": {"duration": "40.0e-6"}, "material": {"scatter": "20.0"}}),
    ("kalthoff", "fracture/kalthoff.nml",
     {"body": {"points": "50, 100"}, "time": {"duration": "60.0e-6"}}),
    ("mixed", "trade/precision.nml", {"body": {"points": "80, 40"}, "scene": {"precision": "'mixed'"}}),
    ("block in motion", "trade/steps_block.nml", {}),
]
LEFT_OUT = ("study",)
TABLES = ("history.csv", "fragments.csv")  # compared as text
OF_BOTH = ("block", "plate")  # written as .vtu files, too
SHORT = ("bar", "block", "plate", "hole", "failure", "crack", "glass", "mixed")
# The same points as a list, whose sums depend on the ranks in the last digits: differences grow with
# the steps, so the runs are short.
LISTS = ("crack", "glass")
ROUNDING = 1.0e-12
# A cloud, and what is computed with it.
CLOUD = """
&scene dimension = 2, thickness = 1.0 /
&body file = 'cloud.txt' /
&material youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0 /
&horizon ratio = 3.015 /
&region name = 'left', where = 'x < 0.03' /
&region name = 'right', where = 'x > 0.41' /
&no_fail region = 'left' /
&no_fail region = 'right' /
&boundary name = 'left', region = 'left', LEFT /
&boundary name = 'right', region = 'right', RIGHT /
&time TIME /
&output every = 50, fields = 'displacement', 'damage', 'stress', precision = 'double' /
"""
LONG_CLOUD = """
&scene dimension = 3 /
&body file = 'cloud_{rows}.txt' /
&material model = 'bond_based', youngs_modulus = 1.0e9, density = 1000.0 /
&horizon surface_correction = 'none' /
&time steps = 2 /
&output every = 2, fields = 'displacement' /
"""
PULLED = {"LEFT": "velocity_x = -10.0", "RIGHT": "velocity_x = 10.0", "TIME": "steps = 150"}
CLOUDS = [
    ("small strain", PULLED, ()),
    ("breaking", PULLED, ("--set", "material%critical_stretch=2.0e-3")),
    ("large strain", {**PULLED, "RIGHT": "velocity_x = 150.0"}, ()),
    # so fast that the parts of forces that copies have would drive them beyond what is stable
    ("fast", {**PULLED, "RIGHT": "velocity_x = 300.0"}, ()),
    ("static", {"LEFT": "displacement_x = 0.0", "RIGHT": "displacement_x = 1.0e-4",
                "TIME": "method = 'relaxation'"}, ()),
]
# Stopped again and again and continued on other numbers of ranks, in turn: the scene, changed keys,
# and whether bonds break.
REGROUPED = [
    ("crack", (), True),
    ("glass", ("--set", "time%integrator='velocity_verlet'"), True),
    ("kalthoff", ("--set", "time%integrator='adams_bashforth'"), True),
    ("plate", (), False),
    ("hole", (), False),
    ("failure", (), True),
]
REGROUPED_SHORT = ("crack", "failure")
# A bar, whose halos are small, and a short one for what the program takes without points.
BAR = """&scene dimension = 3 /
&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.25 model = 'bond_based' /
&body lower = 0, 0, 0 upper = 1, 1, {length} points = 30, 30, {points} /
&horizon ratio = 3.015 family = 'lattice' surface_correction = 'none' /
&time steps = 2 /
&output every = 2 history_every = 2 fields = 'displacement' /
"""
MEMORY_RANKS = 12
# Bodies that overlap on more than one rank.
OVERLAP = """&scene dimension = 2 /
&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3333 model = 'bond_based' /
&body lower = 0, 0 upper = 1, 1 points = 40, 40 /
&body lower = 0.97, 0.2 upper = 1.57, 0.8 points = 21, 21 /
&time steps = 2 /
"""
# Errors that all ranks find at once, several of them, and one alone: the initial velocity, and the
# first point without one.
NO_NUMBER = """&scene dimension = 2 /
&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3333 model = 'bond_based' /
&body lower = 0, 0 upper = 1, 1 points = 40, 40 /
&initial velocity_x = '{}' /
&time steps = 2 /
"""
FINDERS = [
    ("all ranks", "sqrt(x - 2)", 1),
    ("the ranks with x > 0.6", "sqrt(0.6 - x)", 25),
    ("the ranks at y > 0.5", "sqrt(0.5 - y)", 801),
    ("the first rank", "sqrt(x + y - 0.03)", 1),
    ("the last rank", "sqrt(1.97 - x - y)", 1600),
]
MOST_PIECES = 5
PIECE = 0.12  # of the time that the run in one piece takes


class Mpi(Case):
    """The case, with runs on ranks."""

    def write(self, name, origin, changes):
        """A small version of a scene."""
        text = (self.folder.parent / origin).read_text(encoding="utf-8")
        for group in LEFT_OUT:
            text = re.sub(rf"^&{group}\b.*?^/\n", "", text, flags=re.M | re.S)
        for group, keys in changes.items():
            text = change(text, group, **keys)
        path = self.out / (name.replace(" ", "_") + ".nml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def start(self, path, ranks, *options, folder=None, anew=True, quiet=True):
        """Start a run, on one rank by the program without MPI; its folder and process."""
        folder = folder or path.with_suffix("").parent / f"{path.stem}.{ranks}"
        if anew:
            shutil.rmtree(folder, ignore_errors=True)
        words = ["run", str(path), "--output", str(folder), *(["--quiet"] if quiet else []), *options]
        environment = dict(os.environ, OMP_NUM_THREADS="1", OMP_WAIT_POLICY="passive",
                           OMPI_MCA_rmaps_base_oversubscribe="1",
                           OMPI_MCA_hwloc_base_binding_policy="none",
                           OMPI_MCA_mpi_yield_when_idle="1", OMPI_ALLOW_RUN_AS_ROOT="1",
                           OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
        command = [self.program] if ranks == 1 else \
            [os.environ.get("MPIRUN", "mpirun"), "-n", str(ranks), PARALLEL]
        return folder, subprocess.Popen(command + words, env=environment, text=True,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def complete(self, path, ranks, *options):
        """A run to its end; its folder."""
        folder, process = self.start(path, ranks, *options)
        _, errors = process.communicate()
        if process.returncode:
            sys.exit(f"error: {path} on {ranks} ranks ended with status {process.returncode}:\n"
                     f"{errors}")
        return folder


def arrays(folder):
    """All arrays of a results file by their paths, and the tables beside it as text."""
    found = {}
    [path] = folder.glob("*.vtkhdf")

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
            found[name] = item[()]
    with h5py.File(path, "r") as file:
        file.visititems(visit)
    for name in TABLES:
        if (folder / name).is_file():
            found[name] = np.frombuffer((folder / name).read_bytes(), np.uint8)
    return found


def difference(one, other):
    """The largest difference of two runs' arrays over the largest value of each; infinite where
    one lacks an array, or has another size or something that is not a number.
    """
    a, b = arrays(one), arrays(other)
    if a.keys() != b.keys():
        return np.inf
    worst = 0.0
    for name, values in a.items():
        if values.shape != b[name].shape:
            return np.inf
        if np.array_equal(values, b[name]) or name in TABLES:
            continue
        scale = np.abs(values).max()
        found = np.abs(values.astype(float) - b[name]).max() / scale if scale > 0 else np.inf
        worst = max(worst, found if np.isfinite(found) else np.inf)
    return worst


def same_bits(one, other):
    """Whether all arrays of two runs, and the text of their tables, are the same."""
    a, b = arrays(one), arrays(other)
    return a.keys() == b.keys() and all(a[k].tobytes() == b[k].tobytes() for k in a)


def compare_scenes(case, ranks):
    for name, origin, changes in SCENES:
        if case.options.short and name not in SHORT:
            continue
        path = case.write(name, origin, changes)
        both = ("--set", "output%format='both'") if name in OF_BOTH else ()
        one = case.complete(path, 1, *ONE, *both)
        for n in ranks:
            other = case.complete(path, n, *ONE, *both)
            case.equal(f"{name}: {n} ranks, the same bits", same_bits(one, other), True)
            if name in OF_BOTH:
                case.equal(f"{name}: {n} ranks, the same .vtu files", same_series(one, other), True)
        if name not in LISTS:
            continue
        path = case.write(name + " list", origin, {**changes, "horizon": {"family": "'list'"}}
                          if "&horizon" in path.read_text(encoding="utf-8") else changes)
        options = [] if "'list'" in path.read_text(encoding="utf-8") else \
            ["--set", "horizon%family='list'"]
        options += ["--set", "output%fields='displacement'", "--set", "output%precision='double'"]
        one = case.complete(path, 1, *options)
        for n in ranks:
            other = case.complete(path, n, *options)
            positions = difference_of_fields(one, other)
            case.below(f"{name}, list: {n} ranks, of the largest displacement", positions, ROUNDING)
        compare_bits(case, path, f"{name}, list", ranks, *options)
    for name, words, options in CLOUDS:
        compare_bits(case, write_cloud(case, words), f"cloud, {name}", ranks, *options)


def compare_own(case, ranks):
    """Scenes of what acts beside bonds and of what measures: the same bits, also in pieces on other
    numbers of ranks, and, but for --short, the same displacements without --reproducible.
    """
    case.out.mkdir(parents=True, exist_ok=True)
    scenes.write_files(case.out)
    for scene in scenes.OWN:
        if case.options.short and not scene.short:
            continue
        path = case.out / (re.sub(r"\W+", "_", scene.name) + ".nml")
        path.write_text(scene.text, encoding="utf-8")
        whole = compare_bits(case, path, scene.name, ranks, surfaces=scene.surfaces)
        table = np.genfromtxt(whole / "history.csv", delimiter=",", names=True)
        for n in ranks if scene.alike else ():
            case.below(f"{scene.name}: {n} ranks, change of momentum", change_of_momentum(
                path.with_name(f"{path.stem}.{n}")), ROUNDING)
        for column in scene.changes:
            case.equal(f"{scene.name}: {column} changes", np.ptp(table[column]) > 0, True)
        if scene.pieces and not (case.options.short and scene.name not in scenes.PIECES_SHORT):
            go_on(case, scene.name, path, whole, int(table["step"][-1]))
        if case.options.short:
            continue
        one = case.complete(path, 1)
        for n in ranks:
            found = difference_of_fields(one, case.complete(path, n))
            case.below(f"{scene.name}: {n} ranks, of the largest displacement", found, scene.tolerance)


def go_on(case, name, path, whole, steps):
    """A run in pieces on 3, 2, 1 and 3 ranks has the bits of that in one piece."""
    pieces = path.with_name(f"{path.stem}.pieces")
    shutil.rmtree(pieces, ignore_errors=True)
    for i, (n, part) in enumerate(((3, 0.35), (2, 0.5), (1, 0.8), (3, 1))):
        _, process = case.start(path, n, *ONE, "--set", f"time%steps={int(part * steps)}", "--set",
                                "output%checkpoint_every=30", *(["--restart"] if i else []),
                                folder=pieces, anew=False)
        errors = process.communicate()[1]
        if process.returncode:
            sys.exit(f"error: {path} on {n} ranks ended with status {process.returncode}:\n{errors}")
    case.equal(f"{name}, on 3, 2, 1, 3 ranks in turn: the same bits", same_bits(whole, pieces), True)


def compare_bits(case, path, name, ranks, *options, surfaces=False):
    """Runs with --reproducible, whose bonds break if `broken_bonds` is in their history; the folder
    of that on one rank.
    """
    one = case.complete(path, 1, *options, *ONE)
    for n in ranks:
        other = case.complete(path, n, *options, *ONE)
        case.equal(f"{name}: {n} ranks, the same bits", same_bits(one, other), True)
        if surfaces:
            case.equal(f"{name}: {n} ranks, the same surfaces", same_surfaces(one, other), True)
    table = np.genfromtxt(one / "history.csv", delimiter=",", names=True)
    column = [c for c in table.dtype.names if c.startswith("broken_bonds")]
    if column and "breaking" in name:
        case.equal(f"{name}: bonds break", table[column[0]][-1] > 0, True)
    return one


def write_cloud(case, words):
    """A plate of points with jittered places and volumes; its scene with some words."""
    chance = np.random.default_rng(12)
    x, y = np.meshgrid(0.01 * np.arange(45), 0.01 * np.arange(30))
    jitter = 0.002 * (2 * chance.random((2, x.size)) - 1)
    volume = 1.0e-4 * (1 + 0.1 * chance.random(x.size))
    table = np.column_stack([x.ravel() + jitter[0], y.ravel() + jitter[1], 0 * volume, volume])
    case.out.mkdir(parents=True, exist_ok=True)
    np.savetxt(case.out / "cloud.txt", table[chance.permutation(len(table))], fmt="%.17g")
    path = case.out / "cloud.nml"
    text = CLOUD
    for word, value in words.items():
        text = text.replace(word, value)
    path.write_text(text, encoding="utf-8")
    return path


def same_series(one, other):
    """Whether two runs have the same `.vtu` files, at least two, and the same list of them."""
    names = sorted(p.name for p in one.glob("*.vtu")) + [p.name for p in one.glob("*.pvd")]
    return len(names) > 2 and all((one / n).read_bytes() == (other / n).read_bytes() for n in names)


def same_surfaces(one, other):
    """Whether two runs have the same files of rigid bodies' surfaces, at least two, and the same list
    of them.
    """
    names = sorted(p.name for p in one.glob("*_rigid*"))
    return len(names) > 2 and names == sorted(p.name for p in other.glob("*_rigid*")) \
        and all((one / n).read_bytes() == (other / n).read_bytes() for n in names)


def difference_of_fields(one, other):
    """The largest difference of displacements over the largest one, of all outputs."""
    name = "VTKHDF/PointData/displacement"
    a, b = arrays(one)[name], arrays(other)[name]
    found = np.abs(a - b).max() / np.abs(a).max() if a.shape == b.shape else np.inf
    return found if np.isfinite(found) else np.inf


def change_of_momentum(folder):
    """The largest change of the momentum of points of one mass, over the sum of their sizes."""
    found = [v.astype(float) for k, v in sorted(arrays(folder).items()) if k.startswith("outputs/velocity/")]
    change = max(np.abs((v - found[0]).sum(axis=0)).max() for v in found)
    return change / np.abs(found[0]).sum() if len(found) > 2 and np.isfinite(change) else np.inf


def check_finders(case):
    """The lowest of the ranks that find an error reports it, be they all or one."""
    number = case.out / "no_number.nml"
    number.parent.mkdir(parents=True, exist_ok=True)
    for name, velocity, point in FINDERS:
        number.write_text(NO_NUMBER.format(velocity), encoding="utf-8")
        _, process = case.start(number, 3)
        begin = time.time()
        errors = process.communicate()[1]
        case.equal(f"error of {name}: status", process.returncode, 1)
        case.equal(f"error of {name}: messages",
                   re.findall(r"^error: .* at point (\d+) ", errors, re.M), [str(point)])
        case.below(f"error of {name}: ends within [s]", time.time() - begin, 10)


def check_ends(case):
    """What ends one rank ends all, once, with the right status."""
    crack = case.write("end", "plate_crack/slow.nml",
                       {"body": {"points": "100, 100"}, "time": {"step": "6.0e-8", "steps": "100000"},
                        "output": {"every": "20"}})
    # refused by name
    _, process = case.start(crack, 3, "--set", "time%method='relaxation'")
    errors = process.communicate()[1]
    case.equal("refused: status", process.returncode, 1)
    case.equal("refused: errors", len(re.findall(r"^error:", errors, re.M)), 1)
    # too few points
    _, process = case.start(crack, 3, "--set", "body%points=2,1")
    errors = process.communicate()[1]
    case.equal("too few points: status", process.returncode, 1)
    case.equal("too few points: errors", len(re.findall(r"^error:", errors, re.M)), 1)
    # ranks look for overlaps among their own points: one of them reports
    overlap = crack.with_name("overlap.nml")
    overlap.write_text(OVERLAP, encoding="utf-8")
    _, process = case.start(overlap, 3)
    errors = process.communicate()[1]
    case.equal("overlap: status", process.returncode, 1)
    case.equal("overlap: errors", len(re.findall(r"^error: body 1 and body 2 overlap", errors, re.M)), 1)
    # unstable: the history up to there is kept
    folder, process = case.start(crack, 3, "--set", "time%step=1.0e-6")
    errors = process.communicate()[1]
    case.equal("unstable: status", process.returncode, 3)
    case.equal("unstable: errors", len(re.findall(r"^error: unstable", errors, re.M)), 1)
    case.equal("unstable: history", (folder / "history.csv").is_file(), True)
    # the same with contact of points, of which one rank has the fastest
    smash = crack.with_name("smash.nml")
    _, process = case.start(smash, 3, "--set", "time%step=2.0e-6", folder=smash.with_name("smash.end"))
    errors = process.communicate()[1]
    case.equal("unstable contact: status", process.returncode, 3)
    case.equal("unstable contact: errors", len(re.findall(r"^error: unstable", errors, re.M)), 1)
    # stopped in order; mpirun passes this signal on
    folder, process = case.start(crack, 3)
    wait_for(folder / "end.vtkhdf")
    process.send_signal(signal.SIGUSR1)
    process.communicate()
    case.equal("SIGUSR1: status", process.returncode, 4)
    case.equal("SIGUSR1: results can be read", len(arrays(folder)) > 3, True)
    folder, process = case.start(crack, 3, "--max-minutes", "0.03")
    process.communicate()
    case.equal("--max-minutes: status", process.returncode, 4)
    # stopped in order, and continued: the end is that of a run in one piece
    steps = ("--set", "time%steps=3000", "--set", "output%every=500", *ONE)
    whole = case.complete(crack, 3, *steps)
    pieces = crack.with_name("pieces")
    shutil.rmtree(pieces, ignore_errors=True)
    _, process = case.start(crack, 3, *steps, "--max-minutes", "0.015", folder=pieces)
    process.communicate()
    case.equal("to be continued: status", process.returncode, 4)
    _, process = case.start(crack, 3, *steps, "--restart", folder=pieces, anew=False)
    process.communicate()
    case.equal("continued: status", process.returncode, 0)
    case.equal("continued: the same bits", same_bits(whole, pieces), True)
    # a rank is killed
    for victim in (0, 2):
        folder, process = case.start(crack, 3)
        wait_for(folder / "end.vtkhdf")
        ranks = children(process.pid)
        case.equal("ranks found", len(ranks), 3)
        os.kill(ranks[victim], signal.SIGKILL)
        begin = time.time()
        process.communicate()
        case.below(f"kill -9 of rank {victim}: others end within [s]", time.time() - begin, 10)
        case.equal("its status is not 0", process.returncode != 0, True)
        case.equal("results can be read", len(arrays(folder)) > 3, True)


def in_pieces(case, path, folder, minutes, turns, *options):
    """Run a scene in pieces, each on as many ranks as is its turn, the last one to the end; the
    number of pieces, and those ranks that found a checkpoint of another number of them.
    """
    shutil.rmtree(folder, ignore_errors=True)
    regrouped = set()
    last = None
    for piece in range(MOST_PIECES + 1):
        n = turns[piece % len(turns)]
        limit = ["--max-minutes", str(minutes)] if piece < MOST_PIECES else []
        _, process = case.start(path, n, *options, *limit, *(["--restart"] if piece else []),
                                folder=folder, anew=False)
        errors = process.communicate()[1]
        if process.returncode not in (0, 4):
            sys.exit(f"error: {path} in pieces on {n} ranks ended with status {process.returncode}:\n"
                     f"{errors}")
        if piece and n != last:
            regrouped.add((last, n))
        last = n
        if process.returncode == 0:
            break
    return piece + 1, regrouped


def check_regrouped(case):
    """Runs that go on on other numbers of ranks end as the run in one piece on one rank."""
    for name, options, breaks in REGROUPED:
        if case.options.short and name not in REGROUPED_SHORT:
            continue
        [(origin, changes)] = [(o, c) for n, o, c in SCENES if n == name]
        path = case.write(name, origin, changes)
        begin = time.time()
        whole = case.complete(path, 1, *options, *ONE)
        minutes = PIECE * (time.time() - begin) / 60
        pieces = path.with_name(f"{name}.pieces")
        number, regrouped = in_pieces(case, path, pieces, minutes, (3, 2, 1, 3, 1), *options, *ONE)
        case.equal(f"{name}, on 3, 2, 1, 3, 1 ranks in turn: pieces", number > 3, True)
        case.equal(f"{name}: goes on on other numbers of ranks",
                   {(3, 2), (2, 1), (1, 3)} <= regrouped or number < 4, True)
        case.equal(f"{name}, on 3, 2, 1, 3, 1 ranks in turn: the same bits",
                   same_bits(whole, pieces), True)
        if breaks:
            table = np.genfromtxt(pieces / "history.csv", delimiter=",", names=True)
            column = [c for c in table.dtype.names if c.startswith("broken_bonds")][0]
            case.equal(f"{name}: bonds break", table[column][-1] > table[column][0], True)
        if name not in LISTS:
            continue
        options = (*options, "--set", "horizon%family='list'", "--set",
                   "output%fields='displacement'", "--set", "output%precision='double'")
        whole = case.complete(path, 1, *options)
        number, _ = in_pieces(case, path, pieces, minutes, (3, 2, 1, 3, 1), *options)
        case.equal(f"{name}, list, in pieces: pieces", number > 3, True)
        case.below(f"{name}, list, in pieces: of the largest displacement",
                   difference_of_fields(whole, pieces), ROUNDING)


def check_sets(case):
    """Which checkpoints count, and what is said of those that do not."""
    path = case.write("sets", "plate_crack/slow.nml",
                      {"body": {"points": "60, 60"}, "time": {"step": "5.0e-8", "steps": "300"},
                       "output": {"every": "100", "history_every": "10", "checkpoint_every": "40"}})
    whole = case.complete(path, 1, *ONE)
    folder = path.with_name("sets.3")

    def run(n, *options):
        _, process = case.start(path, n, *ONE, *options, folder=folder, anew=False)
        errors = process.communicate()[1]
        return process.returncode, errors

    def files():
        return sorted(p.name for p in folder.glob("*.checkpoint*"))

    shutil.rmtree(folder, ignore_errors=True)
    case.equal("sets: on 3 ranks", run(3, "--set", "time%steps=160")[0], 0)
    of_three = [f"sets.rank-{r}.checkpoint{old}" for r in range(3) for old in ("", ".old")]
    of_one = ["sets.checkpoint", "sets.checkpoint.old"]
    case.equal("sets: files of 3 ranks", files() == of_three, True)
    # one file alone is a part
    status, errors = run(1, "--restart", str(folder / "sets.rank-1.checkpoint"))
    case.equal("sets: a part is refused", (status, "a part of the points" in errors), (1, True))
    # without one of the newest the older set counts
    hidden = folder / "hidden"
    (folder / "sets.rank-1.checkpoint").rename(hidden)
    case.equal("sets: the older one, on one rank", run(1, "--restart", "--set", "time%steps=200")[0], 0)
    case.equal("sets: those of 3 ranks are gone", files() == of_one, True)
    case.equal("sets: to the end on 2 ranks", run(2, "--restart")[0], 0)
    case.equal("sets: the same bits", same_bits(whole, folder), True)
    case.equal("sets: files of 2 ranks", files() == of_three[:4], True)
    # none complete
    for name in of_three[2:4]:
        (folder / name).unlink()
    for n in (1, 2, 3):
        status, errors = run(n, "--restart", "--set", "time%steps=400")
        case.equal(f"sets: none is complete, {n} ranks",
                   (status, len(re.findall(r"^error: no set of checkpoints", errors, re.M))), (1, 1))
    case.equal("sets: --overwrite", run(1, "--overwrite")[0], 0)
    case.equal("sets: nothing is left of 2 ranks", files() == of_one, True)
    # one rank cannot write: all keep what they have
    shutil.rmtree(folder)
    run(3, "--set", "time%steps=160")
    kept = [(folder / name).read_bytes() for name in of_three]
    (folder / "sets.rank-1.checkpoint.part" / "x").mkdir(parents=True)
    case.equal("sets: a rank that cannot write", run(3, "--restart", "--set", "time%steps=240")[0], 0)
    case.equal("sets: all keep those before",
               [(folder / name).read_bytes() for name in of_three] == kept, True)


def check_messages(case, ranks):
    """Ranks send what the formula says: displacements and dilatation of each copy."""
    path = scaling.scene(case.out, 16, 1)
    for n in ranks:
        _, sent, messages = scaling.run(path, n, 1)
        formula = scaling.bytes_of_step(3, scaling.halo_of(path, n), scaling.STEPS)
        case.below(f"{n} ranks: bytes of a step beside the formula", abs(sent / formula - 1), 1e-5)
        case.equal(f"{n} ranks: there are messages", messages > 0, True)


def check_memory(case):
    """The most memory of all ranks together is little more than that of one rank alone. Were all
    points made on each rank, it would be 3.4 times as much.
    """
    for what, write in (("a bar", write_bar), ("a cloud", write_long_cloud)):
        used = {}
        for rows in (30, 900):
            path = write(case, rows)
            _, process = case.start(path, 1)
            _, status, usage = os.wait4(process.pid, 0)
            case.equal(f"{what} of {rows} rows: status", status, 0)
            used[rows, 1] = usage.ru_maxrss * 1024.0
            _, process = case.start(path, MEMORY_RANKS, quiet=False)
            text = process.communicate()[0]
            found = re.search(r"peak memory .* of all ([\d.]+) ([kMG]?)B", text)
            used[rows, MEMORY_RANKS] = float(found.group(1)) * scaling.UNITS[found.group(2)] \
                if found else np.inf
        one, all_ranks = (used[900, n] - used[30, n] for n in (1, MEMORY_RANKS))
        case.below(f"{what} on {MEMORY_RANKS} ranks: memory of the points, of that on one rank",
                   all_ranks / one, 1.6)


def write_bar(case, rows):
    """A bar of so many rows of points along its length."""
    path = case.out / f"bar_{rows}.nml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(BAR.format(points=rows, length=rows / 30), encoding="utf-8")
    return path


def write_long_cloud(case, rows):
    """A bar of jittered points, 20 times as many rows, in a file that has them in any order."""
    chance = np.random.default_rng(3)
    x = 0.001 * np.stack(np.meshgrid(*(np.arange(n) for n in (20 * rows, 5, 5)))).reshape(3, -1)
    x += 0.0001 * chance.random(x.shape)
    table = np.column_stack([chance.permutation(x.T), np.full(x.shape[1], 1.0e-9)])
    case.out.mkdir(parents=True, exist_ok=True)
    np.savetxt(case.out / f"cloud_{rows}.txt", table, fmt="%.9g")
    path = case.out / f"cloud_{rows}.nml"
    path.write_text(LONG_CLOUD.format(rows=rows), encoding="utf-8")
    return path


def wait_for(path, seconds=60):
    """Until a file is there, and a little longer."""
    limit = time.time() + seconds
    while not path.is_file() and time.time() < limit:
        time.sleep(0.05)
    time.sleep(0.5)


def children(pid):
    """The processes of the ranks that a process has started, in the order of their numbers."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            environment = (entry / "environ").read_bytes()
            parent = (entry / "stat").read_text().rsplit(")", 1)[1].split()[1]
        except OSError:
            continue
        rank = re.search(rb"(?:OMPI_COMM_WORLD_RANK|PMI_RANK)=(\d+)", environment)
        if rank and b"perifort-mpi" in command_of(entry) and int(parent) in (pid, *below(pid)):
            found.append((int(rank.group(1)), int(entry.name)))
    return [process for _, process in sorted(found)]


def below(pid):
    """The processes that a process has started."""
    try:
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def command_of(entry):
    try:
        return (entry / "cmdline").read_bytes()
    except OSError:
        return b""


def main():
    case = Mpi(__file__, __doc__, options=[
        ("--short", {"action": "store_true", "help": "some scenes on three ranks"}),
        ("--ranks", {"default": "", "help": "numbers of ranks (default: 2,3,4,7; --short: 3)"})])
    if not Path(PARALLEL).is_file():
        sys.exit("error: PERIFORT_MPI does not name the program with MPI; start this as ./pf verify mpi")
    ranks = [int(n) for n in (case.options.ranks or ("3" if case.options.short else "2,3,4,7")).split(",")]
    compare_scenes(case, ranks)
    compare_own(case, ranks)
    check_messages(case, ranks)
    check_memory(case)
    check_regrouped(case)
    check_sets(case)
    check_finders(case)
    check_ends(case)
    case.finish()


if __name__ == "__main__":
    main()
