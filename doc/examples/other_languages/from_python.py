"""The library from Python, by ctypes: a wave in a bar, stopped when it has gone three quarters of the way.

    ./pf library
    python3 doc/examples/other_languages/from_python.py
"""
import ctypes as c
import math
import os
import sys

lib = c.CDLL(sys.argv[1] if len(sys.argv) > 1 else os.path.join("build", "lib", "libperifort.so"))


class Instant(c.Structure):
    _fields_ = [("step", c.c_int64), ("load_step", c.c_int64), ("time", c.c_double), ("broken_bonds", c.c_int64),
                ("dissipated_energy", c.c_double), ("external_work", c.c_double), ("last", c.c_int)]


Observer = c.CFUNCTYPE(c.c_int, c.POINTER(Instant), c.c_void_p)


class Options(c.Structure):
    _fields_ = [("directory", c.c_char_p), ("threads", c.c_int), ("overwrite", c.c_int), ("restart", c.c_int),
                ("verbose", c.c_int), ("max_minutes", c.c_double), ("observe", Observer), ("data", c.c_void_p)]


lib.perifort_message.restype = lib.perifort_column_name.restype = c.c_char_p
for count in (lib.perifort_rows, lib.perifort_columns, lib.perifort_points):
    count.restype, count.argtypes = c.c_int64, [c.c_void_p]
lib.perifort_column_name.argtypes = [c.c_void_p, c.c_int64]
lib.perifort_field.argtypes = [c.c_void_p, c.c_char_p, c.POINTER(c.c_double), c.c_int64]
lib.perifort_positions.argtypes = [c.c_void_p, c.POINTER(c.c_double), c.c_int64]


def need(status, allowed=(0,)):
    if status not in allowed:
        sys.exit(lib.perifort_message().decode())


scene, answer = c.c_void_p(), c.c_void_p()
need(lib.perifort_scene_from_text(b"""
    &scene dimension = 1 /
    &body lower = 0.0, upper = 1.0, points = 400 /
    &material model = 'bond_based', youngs_modulus = 200.0e9, density = 7850.0 /
    &boundary side = 'x_min', velocity_x = 1.0 /
    &time duration = 1.0 /""", b"wave", c.byref(scene)))

speed = math.sqrt(200.0e9 / 7850.0)
until = 0.75 / speed
observer = Observer(lambda instant, data: instant.contents.time >= until)  # keep it while the run needs it
need(lib.perifort_run(scene, c.byref(Options(observe=observer)), c.byref(answer)), allowed=(4,))
print(lib.perifort_message().decode())
print("columns:", ", ".join(lib.perifort_column_name(answer, i).decode() for i in range(lib.perifort_columns(answer))))

points = lib.perifort_points(answer)
u, x = (c.c_double * (3 * points))(), (c.c_double * (3 * points))()
need(lib.perifort_field(answer, b"displacement", u, len(u)))
need(lib.perifort_positions(answer, x, len(x)))
# behind the front the bar is strained by v/c, so u = v (t - x/c); its centre is at x = c t / 2
centre = min(range(points), key=lambda i: abs(x[3 * i] - 0.375))
expected = 1.0 * (until - x[3 * centre] / speed)
print(f"displacement at {x[3 * centre]:.4f} m: {u[3 * centre]:.4e} m, expected {expected:.4e} m")
lib.perifort_free_answer(answer)
lib.perifort_free_scene(scene)
if not abs(u[3 * centre] / expected - 1) < 0.02:
    sys.exit("the displacement is off")
