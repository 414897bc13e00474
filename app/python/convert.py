"""A mesh in any format that meshio reads, as a MSH 4.1 file, which a body can be.

    ./pf convert FILE [--to FILE.msh]

Sets of cells, and whole numbers by which some formats tag cells, become physical groups with their
names. Shapes that perifort has no use for (polygons, vertices, ..) are left out and counted.
"""
import argparse
import sys
from pathlib import Path

import meshio
import numpy as np

# Kinds of cells: dimension, and number of Gmsh's type.
KINDS = {"line": (1, 1), "line3": (1, 8), "triangle": (2, 2), "triangle6": (2, 9), "quad": (2, 3),
         "quad8": (2, 16), "quad9": (2, 10), "tetra": (3, 4), "tetra10": (3, 11),
         "hexahedron": (3, 5), "hexahedron20": (3, 17), "hexahedron27": (3, 12), "wedge": (3, 6),
         "wedge15": (3, 18), "pyramid": (3, 7)}
# Nodes of meshio, which are in the order of VTK, in the order of Gmsh, where both differ.
EDGES = [8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14]
ORDERS = {"tetra10": [*range(8), 9, 8], "hexahedron20": [*range(8), *EDGES],
          "hexahedron27": [*range(8), *EDGES, 24, 22, 20, 21, 23, 25, 26],
          "wedge15": [*range(6), 6, 8, 12, 7, 13, 14, 9, 11, 10]}
TAGS = ("gmsh:physical", "medit:ref", "cell_tags", "flac3d:group", "avsucd:material", "su2:tag",
        "tetgen:ref", "nastran:ref", "netgen:index", "material", "CellEntityIds")


def groups_of(mesh):
    """For each block of cells the set of group names of every cell."""
    names = [[set() for _ in block.data] for block in mesh.cells]
    for name, members in mesh.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for block, cells in enumerate(members):
            for cell in ([] if cells is None else cells):
                names[block][int(cell)].add(name)
    for key in TAGS:
        for block, tags in enumerate(mesh.cell_data.get(key, [])):
            if np.issubdtype(np.asarray(tags).dtype, np.integer) and np.ndim(tags) == 1:
                dim = KINDS.get(mesh.cells[block].type, (-1, 0))[0]
                known = {int(value[0]): name for name, value in mesh.field_data.items()
                         if len(value) > 1 and int(value[1]) == dim}
                for cell, tag in enumerate(tags):
                    if int(tag) != 0:
                        names[block][cell].add(known.get(int(tag), str(int(tag))))
    return names


def write(mesh, path):
    """The file. Cells of the same dimension and groups are one entity of Gmsh."""
    names = groups_of(mesh)
    entities, blocks, left_out = {}, {}, 0
    for block, cells in enumerate(mesh.cells):
        if cells.type not in KINDS:
            left_out += len(cells.data)
            continue
        dim = KINDS[cells.type][0]
        order = np.asarray(cells.data)[:, ORDERS.get(cells.type, slice(None))]
        for cell, nodes in enumerate(order):
            key = (dim, tuple(sorted(names[block][cell])))
            number = entities.setdefault(key, len(entities) + 1)
            blocks.setdefault((dim, number, cells.type), []).append(nodes)
    if not blocks:
        sys.exit("error: the mesh has no cells that a body could be made of")
    groups = {}
    for dim, inside in entities:
        for name in inside:
            groups.setdefault((dim, name), len(groups) + 1)
    points = np.zeros((len(mesh.points), 3))
    points[:, :mesh.points.shape[1]] = mesh.points
    total = sum(len(cells) for cells in blocks.values())
    with open(path, "w", encoding="utf-8") as file:
        file.write("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")
        if groups:
            file.write(f"$PhysicalNames\n{len(groups)}\n")
            for (dim, name), tag in groups.items():
                file.write(f'{dim} {tag} "{name}"\n')
            file.write("$EndPhysicalNames\n")
        counts = [sum(key[0] == dim for key in entities) for dim in range(4)]
        file.write("$Entities\n" + " ".join(map(str, counts)) + "\n")
        for dim in range(4):
            for (own, inside), number in entities.items():
                if own == dim:
                    tags = " ".join(str(groups[(dim, name)]) for name in inside)
                    file.write(f"{number} 0 0 0 0 0 0 {len(inside)} {tags} 0\n")
        file.write("$EndEntities\n$Nodes\n")
        first = next(iter(blocks))
        file.write(f"1 {len(points)} 1 {len(points)}\n{first[0]} {first[1]} 0 {len(points)}\n")
        file.writelines(f"{i}\n" for i in range(1, len(points) + 1))
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        file.write(f"$EndNodes\n$Elements\n{len(blocks)} {total} 1 {total}\n")
        at = 0
        for (dim, number, kind), cells in blocks.items():
            file.write(f"{dim} {number} {KINDS[kind][1]} {len(cells)}\n")
            for nodes in cells:
                at += 1
                file.write(f"{at} " + " ".join(str(int(node) + 1) for node in nodes) + "\n")
        file.write("$EndElements\n")
    return groups, total, left_out


def main():
    """Read, write, and say what was written."""
    parser = argparse.ArgumentParser(prog="pf convert", description=__doc__.split("\n", 1)[0])
    parser.add_argument("file", help="the mesh")
    parser.add_argument("--to", help="the file to write; default: FILE with the ending .msh")
    options = parser.parse_args()
    path = Path(options.to) if options.to else Path(options.file).with_suffix(".msh")
    if path.exists() and path.samefile(options.file):
        sys.exit("error: this would write over the mesh itself; name another file by --to")
    try:
        mesh = meshio.read(options.file)
    except SystemExit:
        sys.exit(f"error: meshio cannot read {options.file}")
    except Exception as fault:  # meshio raises whatever its readers meet
        sys.exit(f"error: meshio cannot read {options.file}: {fault}")
    groups, total, left_out = write(mesh, path)
    print(f"{path}: {len(mesh.points)} nodes, {total} elements")
    for (dim, name), _ in groups.items():
        print(f"  group of dimension {dim}: {name}")
    if left_out:
        print(f"  left out: {left_out} cells of shapes that a body cannot have")
    if mesh.point_sets:
        print("  left out: sets of points: " + ", ".join(mesh.point_sets))


if __name__ == "__main__":
    main()
