"""The book's plate under tension from meshes, judged as the case plate_tension judges lattices."""
import os
import re
import subprocess
import sys
from pathlib import Path

from common import change

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "plate_tension"))
from checks import KNOWN, MODULUS, STRESS, judge, strains  # noqa: E402


def make_mesh(case, name, size, *kind):
    """Have make_meshes.py write a mesh into the folder of the results."""
    if "CASE_PYTHON" not in os.environ:
        sys.exit("error: start this as ./pf verify mesh_plate: CASE_PYTHON names no python with "
                 "gmsh")
    case.out.mkdir(parents=True, exist_ok=True)
    subprocess.run([os.environ["CASE_PYTHON"], str(case.folder / "make_meshes.py"),
                    str(case.out / name), str(size), *kind], check=True)


def meshed(case, model, mesh):
    """The scene of plate_tension with a mesh for its lattice."""
    text = case.scene(f"../plate_tension/{model}.nml")
    text = re.sub(r"^  (lower|upper|points) = .*\n", "", text, flags=re.M)
    for side, name in (("x_min", "LEFT"), ("x_max", "RIGHT")):
        text = text.replace(f"'{side}'", f"'plate:{name}'")
    return change(text, "body", mesh=f"'{mesh}'", scale="1e-3")


def book_plates(case):
    """Squares, whose points are those of the lattice, pass all its checks. Triangles have the known
    errors of irregular points, and none but that of finite strain, 0.001, with consistent weights.
    """
    make_mesh(case, "squares.msh", 10.0, "squares")
    make_mesh(case, "triangles_30.msh", 30.0, "triangles")
    for model, (nu, _, _) in KNOWN.items():
        results = case.run(f"squares_{model}.nml", meshed(case, model, "squares.msh"))
        case.equal(f"book's plate of squares, {model}: points", len(results.points), 5000)
        judge(case, f"book's plate of squares, {model}", results, model)
        scene = meshed(case, model, "triangles_30.msh")
        if "&horizon" not in scene:
            scene += "&horizon\n/\n"
        for correction, along, across in (("energy", 0.03, 0.08), ("consistent", 1e-3, 1e-3)):
            results = case.run(f"triangles_{model}_{correction}.nml", change(
                scene, "horizon", surface_correction=f"'{correction}'"))
            found = strains(results)
            name = f"book's plate of triangles, {model}, '{correction}'"
            case.near(f"{name}: strain along x inside [-]", found[0], STRESS / MODULUS,
                      relative=along)
            case.near(f"{name}: strain along y inside [-]", found[1], -nu * STRESS / MODULUS,
                      relative=across)
