"""Pieces of eight points that fly about in a closed box and hit each other and its walls: momentum is not theirs alone,
but energy is. It must not leak beyond what the integrator does.

By default 64 pieces, 20,000 steps and the same time in half steps; with --full 1,000 pieces and 1,000,000 steps, which
takes an hour on two cores.
"""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from common import Case  # noqa: E402

SPACING, PITCH, MODULUS, DENSITY, SPEED = 1e-3, 6, 1e9, 1000.0, 20.0
# Of the limit of the time step: the second run's is half of the first one's
SAFETY = 0.4


def box_of_pieces(edge, steps, safety, rows):
    """A scene with edge^3 pieces; the walls are six half-spaces that do not move."""
    size, pitch = edge * PITCH * SPACING, PITCH * SPACING
    # cells 2 and 3 of every six along each axis
    inside = "*".join(f"(abs(mod({c}, {pitch}) - {3 * SPACING}) < {SPACING})" for c in "xyz")
    text = f"""&scene
  title = 'pieces in a box'
  dimension = 3
/
&body
  name = 'pieces'
  lower = 0, 0, 0
  upper = {size}, {size}, {size}
  points = {edge * PITCH}, {edge * PITCH}, {edge * PITCH}
/
&keep where = '{inside}' /
&material
  youngs_modulus = {MODULUS}
  poissons_ratio = 0.25
  density = {DENSITY}
  model = 'bond_based'
/
&horizon
  surface_correction = 'none'
/
&region name = 'all' where = '1' /
"""
    # a velocity for each piece, as if by chance
    number = f"(floor(x/{pitch}) + {edge}*floor(y/{pitch}) + {edge**2}*floor(z/{pitch}))"
    velocities = [f"velocity_{c} = '{SPEED}*(2*mod(sin({number} + 1)*{factor}, 1) - 1)'"
                  for c, factor in zip("xyz", (1e3, 2.7e3, 4.3e3))]
    text += "&initial region = 'all' " + " ".join(velocities) + " /\n&contact within = 'pieces' /\n"
    for axis in range(3):
        for side in (0, 1):
            centre, normal = [0.0] * 3, [0.0] * 3
            centre[axis] = size if side else 0.0
            normal[axis] = -1.0 if side else 1.0
            text += (f"&rigid name = 'wall{axis}{side}' shape = 'half_space' centre = {centre[0]}, {centre[1]}, "
                     f"{centre[2]} normal = {normal[0]}, {normal[1]}, {normal[2]} /\n"
                     f"&contact between = 'pieces', 'wall{axis}{side}' /\n")
    return text + f"""&time
  integrator = 'velocity_verlet'
  safety = {safety}
  steps = {steps}
/
&output
  every = {steps}
  history_every = {steps // rows}
  fields = 'displacement'
/
"""


def energy_of(case, name, edge, steps, safety, rows):
    """The energy, its kinetic part and that of contact at the rows of the history."""
    results = case.run(name, box_of_pieces(edge, steps, safety, rows))
    history = results.history
    # the strain energy has that of contact in it
    kinetic = np.array(history["kinetic_energy"])
    return kinetic + np.array(history["strain_energy"]), kinetic, np.array(history["contact_energy"])


def main():
    case = Case(__file__, __doc__, options=[
        ("--full", {"action": "store_true", "help": "1,000 pieces, 1,000,000 steps"})])
    edge, steps, rows = (10, 1000000, 1000) if case.options.full else (4, 20000, 200)
    energy, kinetic, contact = energy_of(case, "pieces", edge, steps, SAFETY, rows)
    case.above("rows of the history in which pieces touch something [-]",
               np.count_nonzero(contact > 1e-9 * energy[0]) / energy.size, 0.02)
    case.below("least kinetic energy over that of the start: pieces have hit something hard [-]",
               kinetic.min() / kinetic[0], 0.99)
    # What the integrator conserves is near the energy, off by the square of the step: the same time in steps of half
    # the length has at most half of the difference, and it does not grow from the first fifth to the last
    runs = [("steps", energy, 1e-4)]
    case.below("largest difference of the energy from that of the start, over it [-]",
               np.abs(energy / energy[0] - 1).max(), 1e-3)
    if not case.options.full:
        finer = energy_of(case, "pieces_finer", edge, 2 * steps, SAFETY / 2, rows)[0]
        case.below("the same in steps of half the length [-]", np.abs(finer / finer[0] - 1).max(), 5e-4)
        runs.append(("half steps", finer, 5e-5))
    for name, found, limit in runs:
        fifths = [part.mean() / found[0] for part in np.array_split(found, 5)]
        case.below(f"{name}: mean of the last fifth less that of the second, over the energy [-]",
                   abs(fifths[4] - fifths[1]), limit)
    case.finish()


main()
