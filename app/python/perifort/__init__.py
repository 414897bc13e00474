"""Scenes, runs and results of perifort, a peridynamics solver.

    import perifort
    scene = perifort.Scene.read("strip.nml")
    scene["material"]["youngs_modulus"] = 72.0e9
    results = perifort.run(scene)                     # or perifort.open("out/strip")
    force = results.history["grip_reaction_x"]        # an array; force.unit is "N"
    stress = results.field("stress_xx")               # of the last output
    results.plot()                                    # pictures beside the results

`Scene` builds, reads and writes scenes and checks their keys against the input reference; `run`
starts the program; `Results`, from `run` or `open`, reads what it wrote; `sweep` runs a scene for
several values of its keys. numpy and h5py are needed, matplotlib for pictures, pyvista for
`to_pyvista`.
"""
from .program import RunError, find_program, run
from .reference import Reference, reference
from .results import Columns, Quantity, Results
from .results import open_results as open
from .scene import Group, Scene, SceneError
from .sweep import Table, sweep

__version__ = "0.2.0"
__all__ = ["Columns", "Group", "Quantity", "Reference", "Results", "RunError", "Scene",
           "SceneError", "Table", "find_program", "open", "reference", "run", "sweep"]
