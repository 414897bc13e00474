"""Scenes of what acts on points beside bonds and of what measures them, small ones, for several ranks."""
import numpy as np

SPRINGS = """
&scene dimension = 2, thickness = 0.01 /
&body lower = 0.0, 0.0, upper = 0.6, 0.3, points = 60, 30 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0 /
&horizon ratio = 3.015 /
&region name = 'corner', shape = 'box', lower = 0.0, 0.0, upper = 0.05, 0.04 /
&load side = 'x_max', force_x = 2.0e5, stiffness = 4.0e8, 1.0e8, 0.0 /
&load region = 'corner', stiffness = 3.0e8, 3.0e8, 0.0 /
&time TIME /
&output every = 40, history_every = 5, fields = 'displacement', 'velocity', 'strain', precision = 'double' /
"""

ABSORBING = """
&scene dimension = 2, thickness = 1.0 /
&body lower = 0.0, 0.0, upper = 0.6, 0.3, points = 60, 30 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0 /
&horizon ratio = 3.015 /
&boundary side = 'x_max', absorbing = .true. /
&boundary side = 'y_min', absorbing = .true. /
&initial velocity_x = 'exp(-((x - 0.4)^2 + (y - 0.1)^2)/0.05^2)' /
&time steps = 160 /
&output every = 40, history_every = 4, fields = 'displacement', 'velocity', precision = 'double' /
"""

HEAT = """
&scene dimension = 2, thickness = 1.0 /
&body name = 'cold', lower = 0.0, 0.0, upper = 0.6, 0.3, points = 60, 30 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0,
  thermal_expansion = 1.0e-5, critical_stretch = 8.0e-4 /
&horizon ratio = 3.015 /
&region name = 'hot', shape = 'box', lower = 0.0, 0.0, upper = 0.25, 0.12 /
&region name = 'spot', shape = 'box', lower = 0.5, 0.2, upper = 0.55, 0.25 /
&boundary name = 'left', region = 'left', displacement_x = 0.0, displacement_y = 0.0 /
&region name = 'left', where = 'x < 0.03' /
&initial region = 'hot', temperature_change = '100*(1 + x/0.25)', times = 0.0, 2.0e-5, 6.0e-5,
  values = 0.0, 1.0, 0.6 /
&initial region = 'spot', temperature_change = '200*sin(t/4e-5)*(1 + y)' /
&time TIME /
&output every = 20, history_every = 6, fields = 'displacement', 'damage', 'stress', precision = 'double' /
"""

# without bonds that break, to static equilibrium
WARM = HEAT.replace(", critical_stretch = 8.0e-4", "").replace(", 'damage'", "") \
    .replace("times = 0.0, 2.0e-5, 6.0e-5,", "times = 0.0, 0.5, 1.0,").replace("sin(t/4e-5)", "sin(t)")

FILE = """
&scene dimension = 2, thickness = 1.0 /
&body lower = 0.0, 0.0, upper = 0.4, 0.2, points = 40, 20 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0,
  thermal_expansion = 1.0e-5 /
&horizon ratio = 3.015 /
&boundary name = 'top', side = 'y_max', velocity_y = 0.0 /
&initial file = 'start.txt' /
&time steps = 120 /
&output every = 40, history_every = 5, fields = 'displacement', 'stress', precision = 'double' /
"""

MEASURES = """
&scene dimension = 2, thickness = 0.01 /
&body lower = 0.0, 0.0, upper = 0.6, 0.3, points = 60, 30 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0,
  critical_stretch = 2.0e-3 /
&horizon ratio = 3.015 /
&boundary side = 'x_min', velocity_x = -4.0 /
&boundary side = 'x_max', velocity_x = 4.0, velocity_y = 1.0 /
&crack from = 0.3, -0.01, to = 0.3, 0.1 /
&section name = 'along', point = 0.0, 0.15, normal = 0.0, 1.0 /
&section name = 'across', point = 0.21, 0.15, normal = 2.0, 1.0 /
&section name = 'part', point = 0.55, 0.0, normal = 1.0, 0.0, lower = 0.0, 0.02, upper = 1.0, 0.09 /
&probe name = 'cut', point = 0.301, 0.1503, interpolate = .true., fields = 'displacement', 'stress', 'damage' /
&probe name = 'corner', point = 0.6, 0.3, interpolate = .true., fields = 'velocity', 'energy_density' /
&line name = 'ahead', from = -0.05, 0.12, to = 0.65, 0.19, points = 71, fields = 'displacement', 'stress' /
&line name = 'short', from = 0.02, 0.28, to = 0.04, 0.29, points = 4, fields = 'damage' /
&time TIME /
&output every = 40, history_every = 5, fields = 'displacement', 'damage', precision = 'double' /
"""


class Scene:
    """A scene, what stands in place of its words, and what is asked of it."""

    def __init__(self, name, text, words=None, changes=(), short=True, pieces=False, tolerance=1e-12,
                 surfaces=False):
        self.name, self.text = name, text
        for word, value in (words or {}).items():
            self.text = self.text.replace(word, value)
        self.changes = changes      # columns of the history that must change
        self.short = short          # it is in --short
        self.pieces = pieces        # it is stopped and goes on on other numbers of ranks, too
        self.tolerance = tolerance  # of displacements without --reproducible, over the largest one
        self.surfaces = surfaces    # it writes surfaces of rigid bodies


STATIC = "method = 'relaxation' /\n&relaxation load_steps = 2, tolerance = 1.0e-9"
OWN = [
    Scene("springs", SPRINGS, {"TIME": "steps = 160"}, pieces=True),
    Scene("springs at rest", SPRINGS, {"TIME": STATIC}, tolerance=1e-6),
    Scene("springs at rest, dynamic", SPRINGS,
          {"TIME": STATIC.replace("1.0e-9", "1.0e-6, solver = 'dynamic_relaxation'")}, short=False,
          tolerance=1e-5),
    Scene("absorbing", ABSORBING, pieces=True),
    Scene("heat", HEAT, {"TIME": "steps = 78"}, changes=("broken_bonds",), pieces=True),
    Scene("heat at rest", WARM, {"TIME": STATIC}, tolerance=1e-6),
    Scene("file", FILE),
    Scene("measures", MEASURES, {"TIME": "steps = 160"}, pieces=True,
          changes=("broken_bonds", "part_force_x", "cut_damage", "corner_energy_density")),
    Scene("measures at rest", MEASURES.replace("velocity_x = -4.0", "displacement_x = -1.0e-5")
          .replace("velocity_x = 4.0, velocity_y = 1.0", "displacement_x = 2.0e-5"),
          {"TIME": STATIC + ", growth = 'load_steps'"}, short=False, tolerance=1e-6),
]


def write_files(folder):
    """What the scenes read: initial values of each point, in the order of the results."""
    chance = np.random.default_rng(7)
    values = (chance.random((40 * 23, 4)) - 0.5) * [1e-6, 1e-6, 0.2, 80.0]
    np.savetxt(folder / "start.txt", values,
               header="displacement_x displacement_y velocity_y temperature_change", comments="",
               fmt="%.17g")
