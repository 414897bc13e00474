"""The parts of make_surface.py as meshes of tetrahedra; needs gmsh, which nothing else here does.

    python3 make_mesh.py FILE SIZE [SEGMENTS]      SIZE: edges of the elements [mm]

In millimetres. The groups are `wall`, `tip` and `PART`.
"""
import sys

import gmsh
from make_surface import profile, width_of


def main():
    path, size = sys.argv[1], float(sys.argv[2])
    segments = int(sys.argv[3]) if len(sys.argv) > 3 else 24
    places = profile(segments)
    long = max(x for x, _ in places)
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    shape = gmsh.model.occ
    corners = [shape.addPoint(x, 0.0, z) for x, z in places]
    edges = [shape.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1])]
    side = shape.addPlaneSurface([shape.addCurveLoop(edges)])
    shape.extrude([(2, side)], 0.0, width_of(segments), 0.0)
    shape.synchronize()
    for name, place in (("wall", 0.0), ("tip", long)):
        gmsh.model.addPhysicalGroup(2, [face for _, face in gmsh.model.getEntities(2) if abs(
            gmsh.model.occ.getCenterOfMass(2, face)[0] - place) < 1e-6 * long], name=name)
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
