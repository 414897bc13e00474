"""Write the meshes of this case; needs gmsh (pip install gmsh), which nothing else here does.

    python make_meshes.py                    plate.msh and hole.msh, which ship with the case
    python make_meshes.py FILE SIZE          the strip with elements of another size [mm]
    python make_meshes.py FILE SIZE KIND     the plate of the case plate_tension: KIND triangles, or
                                             squares

A square plate of triangles, and a strip with a circular hole, at which elements have half the size.
"""
import sys
from pathlib import Path

import gmsh

WIDTH, LENGTH, RADIUS = 50.0, 100.0, 5.0  # [mm]


def name_sides(length, width):
    """Physical groups of the sides, of the hole and of the plate."""
    sides = {}
    for _, curve in gmsh.model.getEntities(1):
        x, y, _ = gmsh.model.occ.getCenterOfMass(1, curve)
        name = "HOLE"
        for side, distance in {"LEFT": x, "RIGHT": x - length, "BOTTOM": y,
                               "TOP": y - width}.items():
            if abs(distance) < 1e-6 * length:
                name = side
        sides.setdefault(name, []).append(curve)
    for name, curves in sides.items():
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    gmsh.model.addPhysicalGroup(2, [surface for _, surface in gmsh.model.getEntities(2)],
                                name="PLATE")
    return sides


def write(path, length, width, size, near=None):
    """A mesh with elements of `size` [mm]; with `near` there is a hole, at which they have that."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    plate = gmsh.model.occ.addRectangle(0, 0, 0, length, width)
    if near:
        hole = gmsh.model.occ.addDisk(length / 2, width / 2, 0, RADIUS, RADIUS)
        gmsh.model.occ.cut([(2, plate)], [(2, hole)])
    gmsh.model.occ.synchronize()
    sides = name_sides(length, width)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", near or size)
    if near:
        field = gmsh.model.mesh.field
        distance, grade = field.add("Distance"), field.add("Threshold")
        field.setNumbers(distance, "CurvesList", sides["HOLE"])
        field.setNumber(distance, "Sampling", 400)
        for key, value in {"InField": distance, "SizeMin": near, "SizeMax": size,
                           "DistMin": RADIUS, "DistMax": 4 * RADIUS}.items():
            field.setNumber(grade, key, value)
        field.setAsBackgroundMesh(grade)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(path))
    gmsh.finalize()


def write_book(path, size, squares):
    """The book's plate, 1 m x 0.5 m around the origin, of triangles or of squares in rows [mm]."""
    length, width = 1000.0, 500.0
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    plate = gmsh.model.occ.addRectangle(0, 0, 0, length, width)
    gmsh.model.occ.synchronize()
    for name, curves in name_sides(length, width).items():
        for curve in curves:
            along = length if name in ("BOTTOM", "TOP") else width
            gmsh.model.mesh.setTransfiniteCurve(curve, round(along / size) + 1)
    if squares:
        gmsh.model.mesh.setTransfiniteSurface(plate)
        gmsh.model.mesh.setRecombine(2, plate)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.affineTransform([1, 0, 0, -length / 2, 0, 1, 0, -width / 2, 0, 0, 1, 0])
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(path))
    gmsh.finalize()


if __name__ == "__main__":
    if len(sys.argv) > 3:
        write_book(sys.argv[1], float(sys.argv[2]), {"squares": True, "triangles": False}[sys.argv[3]])
    elif len(sys.argv) > 2:
        write(sys.argv[1], LENGTH, WIDTH, float(sys.argv[2]), float(sys.argv[2]) / 2)
    else:
        folder = Path(__file__).parent
        write(folder / "plate.msh", WIDTH, WIDTH, 1.5)
        write(folder / "hole.msh", LENGTH, WIDTH, 2.0, 1.0)
