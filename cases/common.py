"""What every case's verify.py shares: starting the program, reading its results, judging numbers.

    case = Case(__file__, __doc__)     reads --quick, --pictures, --reuse from the command line
    results = case.run("bar.nml")      runs a scene of the case's folder, returns its Results
    case.near("u_x at the end [m]", value, target, relative=0.005)
    case.finish()                      prints the table; exit status 1 if a target was missed
"""
import argparse
import csv
import hashlib
import os
import re
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "app" / "python"))

from perifort import Results, RunError, run  # noqa: E402


def change(scene, group, **keys):
    """A scene's text with keys of the first group of that name set to other values.

    Keys the group already has are replaced, others are added at its end; a key with a subscript is
    not found by its bare name. An unknown group is an error.
    """
    found = re.search(rf"^&{group}\b.*?^/", scene, re.M | re.S)
    if not found:
        raise KeyError(f"the scene has no group &{group}")
    block = found.group(0)
    for key, value in keys.items():
        line = f"  {key} = {value}"
        block, count = re.subn(rf"^\s*{key}\s*=.*$", line, block, flags=re.M)
        if count == 0:
            block = block[:-1] + line + "\n/"
    return scene[:found.start()] + block + scene[found.end():]


class Case:
    """One case being verified."""

    def __init__(self, script, about, options=()):
        """`options`: what a case adds to the command line, as (name, keywords of add_argument)."""
        self.folder = Path(script).resolve().parent
        self.name = self.folder.name
        self.out = Path("out") / self.name
        parser = argparse.ArgumentParser(prog=f"./pf verify {self.name}", description=about,
                                         formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument("--quick", action="store_true", help="leave out the longest runs")
        parser.add_argument("--pictures", action="store_true",
                            help="renew the pictures in the case's folder")
        parser.add_argument("--reuse", action="store_true",
                            help="take results that an earlier call completed with the same scene "
                                 "and program")
        for name, keywords in options:
            parser.add_argument(name, **keywords)
        self.options = parser.parse_args()
        self.program = os.environ.get("PERIFORT", "")
        if not Path(self.program).is_file():
            sys.exit(f"error: start this as ./pf verify {self.name}: PERIFORT does not name "
                     "the program")
        self.rows, self.missed, self.unjudged = [], 0, 0
        self.started = time.time()
        # Of runs done now, not of reused ones
        self.run_times = {}
        print(f"{self.name}: results go to {self.out}", flush=True)

    def scene(self, name):
        """The text of a scene of the case's folder."""
        return (self.folder / name).read_text(encoding="utf-8")

    def run(self, scene, text=None, threads=0):
        """Run a scene of the case's folder, or a variant of it with that text, and read its
        results.

        A variant is written beside its results, which go to out/CASE/STEM in both cases. `threads`:
        0 leaves their number to the program; steps of a few microseconds are better done by 1.
        """
        stem = Path(scene).stem
        output = self.out / stem
        path = self.folder / scene
        if text is not None:
            self.out.mkdir(parents=True, exist_ok=True)
            path = self.out / f"{stem}.nml"
            path.write_text(text, encoding="utf-8")
        stamp = output / "complete"
        mark = hashlib.sha256(path.read_bytes() + Path(self.program).read_bytes()).hexdigest()
        if self.options.reuse and stamp.is_file() and stamp.read_text() == mark:
            print(f"  {stem}: results of an earlier call", flush=True)
            return Results(output)
        # A run that is stopped must not be taken for the complete one before it
        stamp.unlink(missing_ok=True)
        print(f"  {stem}: running ...", end="\n" if sys.stdout.isatty() else " ", flush=True)
        begin = time.time()
        try:
            # A log file has no use for lines of progress
            results = run(path, output, threads=threads if threads > 0 else None, overwrite=True,
                          progress=sys.stdout.isatty(), program=self.program)
        except RunError as fault:
            sys.exit(f"error: {path}: {fault}")
        self.run_times[stem] = time.time() - begin
        print(f"{self.run_times[stem]:.1f} s", flush=True)
        stamp.write_text(mark)
        return results

    def _row(self, what, value, target, tolerance, passed):
        self.rows.append((what, value, target, tolerance, "pass" if passed else "FAIL"))
        self.missed += not passed

    def near(self, what, value, target, relative=None, absolute=None):
        """A number must lie near its target, within a relative or an absolute distance."""
        allowed = absolute if absolute is not None else relative * abs(target)
        tolerance = f"{absolute:.3g}" if absolute is not None else f"{100 * relative:.3g} %"
        self._row(what, f"{value:.6g}", f"{target:.6g}", tolerance,
                  bool(abs(value - target) <= allowed))

    def below(self, what, value, limit):
        """A number must not exceed a limit."""
        self._row(what, f"{value:.4g}", f"< {limit:.4g}", "", bool(value < limit))

    def above(self, what, value, limit):
        """A number must exceed a limit."""
        self._row(what, f"{value:.4g}", f"> {limit:.4g}", "", bool(value > limit))

    def equal(self, what, value, target):
        """A count or a word must be this one."""
        self._row(what, str(value), str(target), "", value == target)

    def show(self, what, value, target=""):
        """A number that is shown beside a known one but not judged."""
        text_of = lambda number: number if isinstance(number, str) else f"{number:.6g}"
        self.rows.append((what, text_of(value), text_of(target), "", "shown"))

    def not_met(self, what, value, target, met, reason):
        """A number whose target is known to be missed, with the reason: it is listed, not judged.
        Once it is met, the row says so.
        """
        verdict = "met, judge it" if met else f"NOT MET: {reason}"
        self.rows.append((what, f"{value:.6g}", f"{target:.6g}", "", verdict))
        self.unjudged += 1

    def finish(self):
        """Print every number with its target; the exit status says whether all were met."""
        header = ("what", "value", "target", "tolerance", "")
        widths = [max(len(row[i]) for row in [header, *self.rows]) for i in range(5)]
        rule = tuple("-" * width for width in widths)
        lines = ["| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |"
                 for row in [header, rule, *self.rows]]
        print("\n" + "\n".join(lines))
        with open(self.out / "numbers.csv", "w", newline="", encoding="utf-8") as table:
            csv.writer(table).writerows([("what", "value", "target", "tolerance", "verdict"),
                                         *self.rows])
        judged = sum(row[4] != "shown" for row in self.rows) - self.unjudged
        print(f"\n{self.name}: {judged - self.missed} of {judged} targets met "
              f"in {time.time() - self.started:.0f} s"
              + (f"; {self.unjudged} known to be missed or not judged" if self.unjudged else ""))
        sys.exit(1 if self.missed else 0)


def wave(x, t, strain, length, speed):
    """Displacement of a bar fixed at 0 and free at `length`, released at t = 0 from u = strain x.

    The sum of the series 8 strain L/pi^2 sum (-1)^n/(2n+1)^2 sin((2n+1) pi x/2L) cos((2n+1) pi c
    t/2L) in closed form: two triangular waves that run apart (d'Alembert), so no term is cut off.
    """
    def start(s):
        # The initial displacement, continued: odd about 0, even about the free end, period 4 L
        s = np.mod(s + length, 4 * length)
        return strain * np.where(s <= 2 * length, s - length, 3 * length - s)
    return (start(x - speed * t) + start(x + speed * t)) / 2
