"""What contact costs: a plate of 100,000 points, four over the thickness, with a ball on it.

    python3 cases/ball_on_plate/cost.py build/bin/optimised/perifort [--threads N] [--repeats N]

Each scene is run with and without the `&contact` in question, both in turn. A step's processor time is the difference
of two runs of 300 and 100 steps over 200, so that what comes before the steps does not count; of the repeats the median
counts. All runs have the same step of 40 ns.
"""
import argparse
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path

HEAD = """&scene
  dimension = 3
/
&material
  youngs_modulus = 70e9
  poissons_ratio = 0.25
  density = 2500.0
  {breaking}
/
&body
  name = 'plate'
  lower = -79e-3, -79e-3, -4e-3
  upper = 79e-3, 79e-3, 0.0
  points = 158, 158, 4
/
"""
RIGID = """&rigid
  name = 'ball'
  shape = 'sphere'
  centre = 0.0, 0.0, 8.01e-3
  radius = 8e-3
  density = 7800.0
  velocity_z = -{speed}
/
"""
ELASTIC = """&body
  name = 'ball'
  shape = 'sphere'
  spacing = 1e-3
  centre = 0.0, 0.0, {height}
  radius = 8e-3
/
&region
  name = 'ball'
  where = 'z > 0.2e-3'
/
&initial
  region = 'ball'
  velocity_z = -20.0
/
"""
TAIL = """&time
  steps = {steps}
  step = 40e-9
/
&output
  every = 100000
  fields = 'displacement'
/
"""
LOSSES = "friction = 0.3 restitution = 0.9"


def scenes():
    """Name, scene without the contact, and with it."""
    whole, brittle = HEAD.format(breaking=""), HEAD.format(breaking="critical_stretch = 1e-3")
    ball, fast = RIGID.format(speed=20), RIGID.format(speed=100)
    # without contact the bodies must not be bonded with each other: the ball is farther away
    far, near = ELASTIC.format(height=40e-3), ELASTIC.format(height=7.91e-3)
    for name, more in (("", ""), (", with friction and restitution", LOSSES)):
        between = f"&contact between = 'plate', 'ball' {more} /\n"
        yield "rigid ball" + name, whole + ball, whole + ball + between
        yield "elastic ball" + name, whole + far, whole + near + between
        hit = brittle + fast + "&contact between = 'plate', 'ball' /\n"
        yield "within the breaking plate" + name, hit, hit + f"&contact within = 'plate' {more} /\n"


def used(program, text, steps, threads, folder):
    """Processor time of a run [s]."""
    scene = folder / "scene.nml"
    scene.write_text(text + TAIL.format(steps=steps), encoding="utf-8")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, "run", scene, "--threads", str(threads), "--output", folder / "out", "--overwrite",
                    "--quiet"], check=True, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="scenes whose name contains this")
    options = parser.parse_args()
    print("scene, processor time of a step without [ms], with [ms], part of the time in contact", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, without, full in scenes():
            if options.only not in name:
                continue
            times = {without: [], full: []}
            for _ in range(options.repeats):
                for text, found in times.items():
                    few, many = (used(options.program, text, steps, options.threads, Path(folder))
                                 for steps in (100, 300))
                    found.append(1e3 * (many - few) / 200)
            one, two = statistics.median(times[without]), statistics.median(times[full])
            print(f"{name}: {one:.2f}, {two:.2f}, {100 * (two - one) / two:.0f} %", flush=True)


main()
