"""The bracket of bracket.stl as a mesh of tetrahedra; needs gmsh, which nothing else here does.

    python3 make_mesh.py FILE SIZE      SIZE: edges of the elements [mm]

In millimetres. The groups are `wall`, `tip` and `PART`.
"""
import sys

import gmsh
from make_surface import LONG, WIDTH, profile


def main():
    path, size = sys.argv[1], float(sys.argv[2])
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    shape = gmsh.model.occ
    corners = [shape.addPoint(x, 0.0, z) for x, z in profile(24)]
    edges = [shape.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1])]
    side = shape.addPlaneSurface([shape.addCurveLoop(edges)])
    shape.extrude([(2, side)], 0.0, WIDTH, 0.0)
    shape.synchronize()
    for name, place in (("wall", 0.0), ("tip", LONG)):
        gmsh.model.addPhysicalGroup(2, [face for _, face in gmsh.model.getEntities(2) if abs(
            gmsh.model.occ.getCenterOfMass(2, face)[0] - place) < 1e-6 * LONG], name=name)
    gmsh.model.addPhysicalGroup(3, [part for _, part in gmsh.model.getEntities(3)], name="PART")
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.model.mesh.generate(3)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(path)
    gmsh.finalize()


if __name__ == "__main__":
    main()
