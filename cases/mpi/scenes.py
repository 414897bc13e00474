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

# A spinning ball that hits a corner of a plate, on one rank alone, a punch of facets that is pressed
# in, and a floor.
BALL = """
&scene dimension = 3, gravity = 0.0, 0.0, -9.81 /
&body name = 'plate', lower = 0.0, 0.0, 0.0, upper = 0.06, 0.04, 0.01, points = 24, 16, 4 /
&material youngs_modulus = 2.0e10, poissons_ratio = 0.25, density = 2200.0, critical_stretch = 2.0e-3 /
&rigid name = 'ball', shape = 'sphere', centre = 0.012, 0.01, 0.01505, radius = 5.0e-3, density = 7800.0,
  velocity_x = 5.0, velocity_z = -60.0, spin_y = 900.0 /
&rigid name = 'floor', shape = 'half_space', centre = 0.0, 0.0, -0.00001, normal = 0.0, 0.0, 1.0 /
&rigid name = 'punch', shape = 'surface', surface = 'punch.stl', scale = 1.0e-3, displacement_x = 0.0,
  displacement_y = 0.0, displacement_z = '-20*t', rotation = 'held' /
&contact between = 'plate', 'ball', friction = 0.3, restitution = 0.7 /
&contact between = 'plate', 'floor', friction = 0.1 /
&contact between = 'plate', 'punch', stiffness = 3.0, damping = 0.2 /
&time TIME /
&output every = 50, history_every = 5, fields = 'displacement', 'velocity', 'damage', precision = 'double' /
"""

# Two bodies of points that never meet, between cylinders and a box that turns freely, in the plane.
ROLLS = """
&scene dimension = 2, thickness = 0.01 /
&body name = 'one', lower = 0.0, 0.0, upper = 0.3, 0.1, points = 48, 16 /
&body name = 'two', lower = 0.35, 0.0, upper = 0.5, 0.1, points = 24, 16 /
&material model = 'state_based', youngs_modulus = 2.0e9, poissons_ratio = 0.3, density = 1200.0 /
&horizon ratio = 3.015 /
&rigid name = 'left', shape = 'sphere', centre = 0.05, -0.0201, radius = 0.02, rotation = 'imposed',
  spin_z = '3000*(1 + t/1e-4)', displacement_x = 0.0, displacement_y = '2*t' /
&rigid name = 'box', shape = 'box', centre = 0.31, 0.131, edges = 0.16, 0.05, 0.0, angle = 5.0, density = 5000.0,
  velocity_y = -30.0 /
&contact between = 'one', 'left', friction = 0.5, damping = 0.1 /
&contact between = 'one', 'box', friction = 0.2 /
&contact between = 'two', 'box' /
&time TIME /
&output every = 60, history_every = 5, fields = 'displacement', 'velocity', precision = 'double' /
"""

# Points that meet points. A disc, a plate and a post of other spacings, which meet two by two.
SLIDE = """
&scene dimension = 2, thickness = 0.01 /
&body name = 'disc', shape = 'sphere', centre = 0.17, 0.1353, radius = 0.04, spacing = 4.0e-3 /
&body name = 'plate', lower = 0.0, 0.0, upper = 0.32, 0.09, points = 64, 18 /
&body name = 'post', lower = 0.321, 0.02, upper = 0.361, 0.14, points = 10, 30 /
&material model = 'state_based', youngs_modulus = 2.0e9, poissons_ratio = 0.3, density = 1200.0 /
&horizon ratio = 3.015 /
&region name = 'disc', where = 'min(y - 0.0905, 0.3 - x) > 0' /
&region name = 'post', where = 'x > 0.3205' /
&initial region = 'disc', velocity_x = 20.0, velocity_y = -40.0 /
&initial region = 'post', velocity_x = -30.0 /
&contact between = 'disc', 'plate', 'post', friction = 0.4, restitution = 0.7 /
&time steps = 220 /
&output every = 60, history_every = 5, fields = 'displacement', 'velocity', precision = 'double' /
"""

# A bar that breaks on a plate, which breaks, too: normals of surfaces that lose bonds, and pieces.
SMASH = """
&scene dimension = 2, thickness = 0.01 /
&body name = 'bar', lower = 0.1, 0.1021, upper = 0.18, 0.2021, points = 20, 25 /
&body name = 'plate', lower = 0.0, 0.0, upper = 0.32, 0.1, points = 80, 25 /
&material youngs_modulus = 7.0e10, poissons_ratio = 0.3333, density = 2400.0, critical_stretch = 1.0e-3 /
&horizon ratio = 3.015 /
&region name = 'bar', where = 'y > 0.101' /
&initial region = 'bar', velocity_y = -200.0 /
&contact between = 'all', friction = 0.3, damping = 0.1, stiffness = 5.0 /
&time steps = 200 /
&output every = 50, history_every = 5, fields = 'displacement', 'velocity', 'damage', precision = 'double' /
"""

# Halves of a block in space, which a crack parts, are pressed together and slide.
HALVES = """
&scene dimension = 3 /
&body name = 'block', lower = 0.0, 0.0, 0.0, upper = 0.04, 0.016, 0.016, points = 20, 8, 8 /
&material youngs_modulus = 2.0e9, poissons_ratio = 0.25, density = 1200.0, critical_stretch = 0.02 /
&horizon ratio = 3.015 /
&crack corner = 0.019999, -1.0, -1.0, edge_1 = 0.0, 3.0, 0.0, edge_2 = 0.0, 0.0, 3.0 /
&region name = 'left', where = 'x < 0.02' /
&initial region = 'left', velocity_x = 40.0, velocity_y = 6.0 /
&contact within = 'block', friction = 0.5 /
&time steps = 120, integrator = 'velocity_verlet' /
&output every = 40, history_every = 5, fields = 'displacement', 'velocity', precision = 'double' /
"""

# Three bodies in space, one above the other, along lines of centres and normals.
STACK = """
&scene dimension = 3 /
&body name = 'a', lower = 0.0, 0.0, 0.0, upper = 0.02, 0.02, 0.008, points = 10, 10, 4 /
&body name = 'b', lower = 0.005, 0.003, 0.0081, upper = 0.021, 0.019, 0.0161, points = 8, 8, 4 /
&body name = 'c', shape = 'sphere', centre = 0.011, 0.01, 0.0232, radius = 0.007, spacing = 1.5e-3 /
&material model = 'state_based', youngs_modulus = 2.0e9, poissons_ratio = 0.3, density = 1200.0 /
&horizon ratio = 3.015, family = 'list' /
&region name = 'c', where = 'z > 0.01611' /
&region name = 'b', where = 'min(z - 0.00805, 0.0161 - z) > 0' /
&initial region = 'c', velocity_z = -90.0, velocity_x = 15.0 /
&initial region = 'b', velocity_z = -60.0 /
&contact between = 'a', 'b', normals = 'centres', damping = 0.2 /
&contact between = 'c', 'b', friction = 0.2 /
&time steps = 150, integrator = 'adams_bashforth' /
&output every = 50, history_every = 5, fields = 'displacement', 'velocity', precision = 'double' /
"""
RIGID = ("contact_energy", "friction_work", "contact_dissipation")


# a crack that grows through a plate of four layers from one side, and another in the middle that branches
TIPS = """
&scene dimension = 3 /
&body lower = 0.0, 0.0, 0.0, upper = 0.6, 0.36, 0.04, points = 60, 36, 4 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.25, density = 8000.0,
  critical_stretch = 1.0e-3 /
&horizon ratio = 3.015 /
&crack corner = 0.0, 0.18, 0.0, edge_1 = 0.15, 0.0, 0.0, edge_2 = 0.0, 0.0, 0.04 /
&crack corner = 0.4, 0.18, 0.0, edge_1 = 0.1, 0.0, 0.0, edge_2 = 0.0, 0.0, 0.04 /
&no_fail shape = 'box', lower(2) = 0.3 /
&no_fail shape = 'box', upper(2) = 0.06 /
&boundary side = 'y_max', velocity_y = 1.6 /
&boundary side = 'y_min', velocity_y = -1.6 /
&tip name = 'left', from = 0.0, 0.18, 0.02, direction = 1.0, 0.0, 0.0, threshold = 0.3 /
&tip name = 'right', from = 0.45, 0.18, 0.02, direction = 1.0, 0.1, 0.0, threshold = 0.3 /
&time steps = 112 /
&output every = 40, history_every = 4, fields = 'displacement', 'damage', precision = 'double' /
"""


# a bar held by two pins, one of which moves; a bar that turns about a pin and breaks on the other
PINS = """
&scene dimension = 2, thickness = 0.01 /
&body lower = 0.0, 0.0, upper = 0.6, 0.2, points = 60, 20 /
&material model = 'state_based', youngs_modulus = 2.0e11, poissons_ratio = 0.3, density = 8000.0BREAK /
&horizon ratio = 3.015 /
&region name = 'left', shape = 'sphere', centre = 0.1, 0.1, radius = 0.05 /
&region name = 'right', shape = 'sphere', centre = 0.5, 0.1, radius = 0.05 /
&boundary name = 'left', region = 'left', motion = 'pin', displacement_x = 0.0, displacement_y = 0.0 /
&boundary name = 'right', region = 'right', motion = 'pin', MOVED /
&load side = 'x_max', force_y = 1.0e4 /
&time TIME /
&output every = 40, history_every = 4, fields = FIELDS, precision = 'double'ALSO /
"""


class Scene:
    """A scene, what stands in place of its words, and what is asked of it."""

    def __init__(self, name, text, words=None, changes=(), short=True, pieces=False, tolerance=1e-12,
                 surfaces=False, alike=False):
        self.name, self.text = name, text
        for word, value in (words or {}).items():
            self.text = self.text.replace(word, value)
        self.changes = changes      # columns of the history that must change
        self.short = short          # it is in --short
        self.pieces = pieces        # it is stopped and goes on on other numbers of ranks, too
        self.tolerance = tolerance  # of displacements without --reproducible, over the largest one
        self.surfaces = surfaces    # it writes surfaces of rigid bodies
        self.alike = alike          # its points have one mass, and nothing acts from outside


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
    Scene("tips", TIPS, pieces=True, changes=("left_projection", "left_length",
                                              "right_projection", "right_projection_mean")),
    Scene("pins, fragments", PINS, {"BREAK": ", critical_stretch = 1.0e-3", "TIME": "steps = 160",
                                    "MOVED": "velocity_x = 8.0, velocity_y = 6.0",
                                    "FIELDS": "'displacement', 'fragment'",
                                    "ALSO": ", fragments = .true."}, pieces=True,
          changes=("left_moment_z", "right_rotation_z", "fragments", "largest_fragment_mass")),
    Scene("pins at rest", PINS, {"BREAK": "", "TIME": STATIC, "FIELDS": "'displacement', 'stress'",
                                 "MOVED": "displacement_y = 1.0e-5", "ALSO": ""}, tolerance=1e-6),
    Scene("measures at rest", MEASURES.replace("velocity_x = -4.0", "displacement_x = -1.0e-5")
          .replace("velocity_x = 4.0, velocity_y = 1.0", "displacement_x = 2.0e-5"),
          {"TIME": STATIC + ", growth = 'load_steps'"}, short=False, tolerance=1e-6),
    Scene("ball", BALL, {"TIME": "steps = 300"}, pieces=True, surfaces=True,
          changes=(*RIGID, "ball_force_x", "ball_moment_y", "floor_force_z", "punch_force_z", "broken_bonds")),
    Scene("rolls", ROLLS, {"TIME": "steps = 300"}, pieces=True, surfaces=True,
          changes=(*RIGID, "left_moment_z", "box_rotation_z", "box_force_y")),
    Scene("slide", SLIDE, pieces=True, changes=RIGID),
    Scene("smash", SMASH, pieces=True, changes=(*RIGID, "broken_bonds"), alike=True),
    Scene("smash, late", SMASH.replace("steps = 200", "steps = 200, breaking = 'after_forces'"), short=False,
          changes=(*RIGID, "broken_bonds"), alike=True),
    Scene("halves", HALVES, pieces=True, changes=RIGID[:2], alike=True),
    Scene("stack", STACK, short=False, pieces=True, changes=RIGID),
]

PIECES_SHORT = ("heat", "smash", "tips")  # with --short in pieces, too

# A wedge that points down on the plate, in mm.
CORNERS = np.array([[40, 10, 16], [52, 10, 16], [46, 10, 10.05], [40, 30, 16], [52, 30, 16], [46, 30, 10.05]], float)
FACETS = ((0, 1, 2), (3, 5, 4), (0, 3, 4), (0, 4, 1), (0, 2, 5), (0, 5, 3), (1, 4, 5), (1, 5, 2))


def write_files(folder):
    """What the scenes read: initial values of each point, in the order of the results."""
    chance = np.random.default_rng(7)
    values = (chance.random((40 * 23, 4)) - 0.5) * [1e-6, 1e-6, 0.2, 80.0]
    np.savetxt(folder / "start.txt", values,
               header="displacement_x displacement_y velocity_y temperature_change", comments="",
               fmt="%.17g")
    lines = ["solid punch"]
    middle = CORNERS.mean(axis=0)
    for facet in FACETS:
        a, b, c = CORNERS[list(facet)]
        if np.dot(np.cross(b - a, c - a), a - middle) < 0:
            b, c = c, b
        lines += ["facet normal 0 0 0", "outer loop",
                  *(f"vertex {x:g} {y:g} {z:g}" for x, y, z in (a, b, c)), "endloop", "endfacet"]
    (folder / "punch.stl").write_text("\n".join([*lines, "endsolid punch", ""]), encoding="utf-8")
