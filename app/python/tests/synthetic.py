"""Result files made by hand, whose contents are known."""
from pathlib import Path

import h5py
import numpy as np

SCENE = """&scene
  title = 'it''s made by hand'
/
&probe
  name = 'end'
/
&probe
  name = 'end_b'
/
"""


def lattice(counts, spacing=1.0e-3):
    """Points of a lattice, x fastest; unused directions are 0."""
    counts = [*counts, 1, 1][:3]
    z, y, x = np.meshgrid(*[(np.arange(n) + (0.5 if n > 1 else 0.0)) * spacing
                            for n in reversed(counts)], indexing="ij")
    return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def write_results(path, points=None, fields=None, history=None, times=(0.0, 1e-5, 2e-5), layer=None,
                  scene=SCENE, spare=0):
    """A file as perifort writes it. `fields`: name -> (unit, components, values (outputs, n[, c]));
    `history`: name -> (unit, origin, values). `spare`: rows and outputs that are not complete yet.
    """
    points = lattice((6, 4)) if points is None else points
    n, rows = len(points), 5
    if fields is None:
        fields = {"damage": ("1", "", np.arange(len(times) * n, dtype=float).reshape(-1, n)),
                  "displacement": ("m", "x y z",
                                   np.arange(len(times) * n * 3, dtype=float).reshape(-1, n, 3))}
    if history is None:
        history = run_history(rows)
    rows = len(next(iter(history.values()))[2])
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root["Points"] = points
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = len(times)
        steps["Values"] = np.concatenate([times, np.full(spare, np.nan)])
        for name, (unit, components, values) in fields.items():
            flat = np.asarray(values, dtype=float)
            flat = flat.reshape(len(times) * n, *flat.shape[2:])
            gap = np.full((spare * n, *flat.shape[1:]), np.nan)
            data = root.create_dataset(f"PointData/{name}", data=np.concatenate([flat, gap]))
            data.attrs["units"] = np.bytes_(unit)
            if components:
                data.attrs["components"] = np.bytes_(components)
        file["points/volume"] = np.full(n, 1e-9)
        file["points/layer"] = np.zeros(n, dtype="i4") if layer is None else layer
        file["points/body"] = np.ones(n, dtype="i4")
        group = file.create_group("history")
        group.attrs["rows"] = rows
        for name, (unit, origin, values) in history.items():
            data = group.create_dataset(name, data=np.concatenate([values, np.full(spare, np.nan)]))
            data.attrs["units"], data.attrs["origin"] = np.bytes_(unit), np.bytes_(origin)
        file["scene/text"] = scene
        file["scene"].attrs["version"] = np.bytes_("0.2.0")
    return path


def run_history(rows=5, static=False, tip=True):
    """Columns as a run has them."""
    time = np.linspace(0, 1 if static else 2e-5, rows)
    found = {"step": ("1", "run", np.arange(rows)), "time": ("s", "run", time)}
    for name in ("kinetic_energy", "strain_energy", "dissipated_energy"):
        found[name] = ("J", "run", time / time[-1])
    found["external_work"] = ("J", "run", 3 * time / time[-1])
    if static:
        found["load_step"] = ("1", "run", np.arange(rows))
        found["residual"] = ("1", "run", np.full(rows, 1e-7))
    for axis in "xy":
        found[f"grip_reaction_{axis}"] = ("N", "boundary", 1e4 * time / time[-1])
        found[f"grip_displacement_{axis}"] = ("m", "boundary", 1e-4 * time / time[-1])
    for name in ("end", "end_b"):
        found[f"{name}_displacement_x"] = ("m", "probe", np.full(rows, 1.0 + len(name)))
    if tip:
        for column, unit in (("x", "m"), ("y", "m"), ("length", "m"), ("projection", "m"),
                             ("speed", "m/s"), ("branches", "1")):
            found[f"notch_{column}"] = (unit, "tip", np.arange(rows, dtype=float))
    return found
