#!/usr/bin/env python3
"""Open results as other programs do and step through their times.

    check_vtk.py NAME.vtkhdf [NAME.pvd] [--partial] [--pyvista]

The HDF5 file is read with h5py and with VTK's own reader, NAME.xdmf beside it with VTK's reader of
XDMF, the .pvd series with VTK's XML reader; their values must agree with h5py's. So do the surfaces of
rigid bodies in NAME_rigid.pvd, where there is one, with the history. --partial: the
file's writer did not live to close it. --pyvista: NAME.xdmf also by the lines of the user guide.
"""
import re
import sys
import xml.etree.ElementTree as tree
from pathlib import Path

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader


def arrays_of(data):
    """The point arrays of a VTK data set by name."""
    point_data = data.GetPointData()
    return {point_data.GetArrayName(i): vtk_to_numpy(point_data.GetArray(i))
            for i in range(point_data.GetNumberOfArrays())}


def check_hdf(path, partial):
    """Check the file's own consistency, then that VTK sees the same numbers in every step."""
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        assert list(root.attrs["Version"]) == [2, 0] and root.attrs["Type"] in (b"PolyData",
                                                                                "PolyData")
        points = root["Points"][:]
        steps = int(root["Steps"].attrs["NSteps"])
        times = root["Steps/Values"][:]
        assert len(times) == steps, f"{len(times)} times for {steps} steps"
        fields = {name: data[:steps * len(points)] for name, data in root["PointData"].items()}
        for name, data in root["PointData"].items():
            assert "units" in data.attrs, f"{name} has no units"
            if not partial:
                assert len(data) == steps * len(points), \
                    f"{name}: {len(data)} rows for {steps} steps"
        if not partial:
            for name, data in root["Steps"].items():
                if isinstance(data, h5py.Dataset):
                    assert len(data) == steps, \
                        f"Steps/{name}: {len(data)} entries for {steps} steps"
        rows = int(file["history"].attrs["rows"])
        for name, data in file["history"].items():
            assert "units" in data.attrs, f"history/{name} has no units"
            assert len(data) >= rows if partial else len(data) == rows, \
                f"history/{name}: {len(data)}, not {rows}"
        for name, data in file["points"].items():
            assert len(data) == len(points), \
                f"points/{name}: {len(data)} values for {len(points)} points"
        assert len(file["scene/text"][()]) > 0

    reader = vtkHDFReader()
    assert reader.CanReadFile(str(path)), f"VTK cannot read {path}"
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == steps, \
        f"VTK sees {reader.GetNumberOfSteps()} steps, not {steps}"
    if steps == 1:
        seen = [reader.GetTimeValue()]
    else:
        seen = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS())
    assert np.array_equal(seen, times), "VTK sees other times"
    n = len(points)
    for step in range(steps):
        reader.SetStep(step)
        reader.Update()
        output = reader.GetOutput()
        assert output.GetNumberOfPoints() == n and output.GetNumberOfVerts() == n
        assert np.array_equal(vtk_to_numpy(output.GetPoints().GetData()), points)
        found = arrays_of(output)
        for name, values in fields.items():
            assert np.array_equal(found[name],
                                  values[step * n:(step + 1) * n]), f"{name}, step {step}"
    print(f"{path}: {steps} steps, {n} points, {rows} history rows, fields {', '.join(fields)}")
    return times, points, fields


def shown_arrays(path):
    """What the .xdmf file beside an HDF5 file shows of it: {name: values of every output}."""
    shown = {}
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        count = int(root["Steps"].attrs["NSteps"]) * len(root["Points"])
        for name, data in root["PointData"].items():
            values = data[:count]
            labels = data.attrs.get("components", b"")
            labels = (labels.decode() if isinstance(labels, bytes) else labels).strip()
            if values.ndim == 1 or values.shape[1] == 3 and labels in ("", "x y z"):
                shown[name] = values
            else:
                shown.update({f"{name}_{label}": values[:, at]
                              for at, label in enumerate(labels.split())})
    return shown


def check_references(path, hdf_path):
    """The .xdmf file is well formed, and what it refers to is there; returns its times."""
    grids = tree.parse(path).getroot().findall("Domain/Grid/Grid")
    with h5py.File(hdf_path, "r") as file:
        for grid in grids:
            items = list(grid.iter("DataItem"))
            assert len(items) > 2, f"{path}: an output without fields"
            for item in items:
                name, inside = item.text.strip().split(":")
                assert name == hdf_path.name, f"{path} refers to {name}"
                data = file[inside]
                shape = tuple(int(number) for number in item.get("Dimensions").split())
                assert data.shape == shape, f"{path}: {inside} has the shape {data.shape}"
                assert data.dtype.itemsize == int(item.get("Precision")), f"{path}: {inside}"
    return [float(grid.find("Time").get("Value")) for grid in grids]


def check_list(path, hdf_path, partial=False):
    """Check the .xdmf file: all outputs of the HDF5 file, or at most one less if it is partial, with
    the times and values that h5py finds. Returns the number of outputs."""
    with h5py.File(hdf_path, "r") as file:
        steps = int(file["VTKHDF/Steps"].attrs["NSteps"])
        times = file["VTKHDF/Steps/Values"][:steps]
        points = file["VTKHDF/Points"][:]
    listed = check_references(path, hdf_path)
    assert len(listed) == steps or partial and len(listed) == steps - 1, \
        f"{path} lists {len(listed)} of {steps} outputs"
    assert np.array_equal(listed, times[:len(listed)]), f"{path} has other times"
    if not partial:
        assert not re.search(r"<\?later", path.read_text()), f"{path} is not a finished list"
    shown = shown_arrays(hdf_path)

    reader = vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    seen = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS())
    assert np.array_equal(seen, listed), f"VTK sees other times in {path}: {seen}"
    n = len(points)
    for step, time in enumerate(seen):
        reader.UpdateTimeStep(time)
        output = reader.GetOutputDataObject(0)
        assert output.GetNumberOfPoints() == n and output.GetNumberOfCells() == n, path
        assert np.array_equal(vtk_to_numpy(output.GetPoints().GetData()), points), path
        found = arrays_of(output)
        assert found.keys() == shown.keys(), f"{path} shows {list(found)}, not {list(shown)}"
        for name, values in shown.items():
            assert np.array_equal(found[name], values[step * n:(step + 1) * n]), \
                f"{path}: {name}, step {step}"
    print(f"{path}: {len(listed)} outputs, {', '.join(shown)}")
    return len(listed)


def check_pyvista(path, hdf_path):
    """The lines of the user guide give all times and values."""
    import pyvista
    reader = pyvista.get_reader(path)
    with h5py.File(hdf_path, "r") as file:
        assert np.array_equal(reader.time_values, file["VTKHDF/Steps/Values"][:]), \
            "pyvista sees other times"
    shown = shown_arrays(hdf_path)
    for step, time in enumerate(reader.time_values):
        reader.set_active_time_value(time)
        mesh = reader.read()
        for name, values in shown.items():
            part = values[step * mesh.n_points:(step + 1) * mesh.n_points]
            assert np.array_equal(mesh[name], part), f"pyvista: {name}, step {step}"
    print(f"{path}: {len(reader.time_values)} outputs in pyvista {pyvista.__version__}")


def check_series(path, partial, hdf=None):
    """Check a .pvd series, against the HDF5 file of the same run if there is one."""
    files = [(float(entry.get("timestep")), path.parent / entry.get("file"))
             for entry in tree.parse(path).getroot().iter("DataSet")]
    assert files, f"{path} lists nothing"
    if hdf is not None and not partial:
        assert [time for time, _ in files] == list(hdf[0]), "the series has other times"
    for step, (_, name) in enumerate(files):
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(name))
        reader.Update()
        output = reader.GetOutput()
        n = output.GetNumberOfPoints()
        assert n > 0 and output.GetNumberOfCells() == n, f"{name}: {n} points"
        found = arrays_of(output)
        assert found, f"{name} holds no arrays"
        if hdf is None or step >= len(hdf[0]):
            continue
        assert np.array_equal(vtk_to_numpy(output.GetPoints().GetData()), hdf[1])
        for key, values in hdf[2].items():
            assert np.array_equal(found[key], values[step * n:(step + 1) * n]), f"{name}: {key}"
    print(f"{path}: {len(files)} files")


def rotation_about(vector):
    """The matrix of a rotation that is given as axis times angle."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def check_surfaces(path, hdf_path):
    """The surfaces of rigid bodies: each is closed, or a patch, and moves as the history says."""
    with h5py.File(hdf_path, "r") as file:
        times = file["VTKHDF/Steps/Values"][:]
        history = {name: data[:] for name, data in file["history"].items()}
        scene = file["scene/text"][()]
    scene = scene.decode() if isinstance(scene, bytes) else scene
    names = re.findall(r"&rigid\s.*?name\s*=\s*'(\w+)'", scene, re.DOTALL)
    files = [(float(entry.get("timestep")), path.parent / entry.get("file"))
             for entry in tree.parse(path).getroot().iter("DataSet")]
    assert [time for time, _ in files] == list(times), f"{path} has other times"
    start, followed = None, 0
    for time, name in files:
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(name))
        reader.Update()
        output = reader.GetOutput()
        assert output.GetNumberOfPoints() > 0 and output.GetNumberOfPolys() > 0, f"{name} is empty"
        x = vtk_to_numpy(output.GetPoints().GetData())
        corners = vtk_to_numpy(output.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        body = vtk_to_numpy(output.GetCellData().GetArray("rigid_body"))
        velocity = vtk_to_numpy(output.GetPointData().GetArray("velocity"))
        assert velocity.shape == x.shape and set(body) == set(range(1, len(names) + 1)), \
            f"{name}: bodies {set(body)}, not {names}"
        start = x if start is None else start
        row = np.flatnonzero(history["time"] == time)
        for number, label in enumerate(names, 1):
            own = np.unique(corners[body == number])
            edges = np.sort(corners[body == number][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
            uses = np.unique(edges, axis=0, return_counts=True)[1]
            assert np.all(uses == 2) or len(own) == 4, f"{name}: {label} is not closed"
            if len(row) == 0:
                continue

            def vector(what, label=label, row=row[0]):
                return np.array([history.get(f"{label}_{what}_{c}", np.zeros(row + 1))[row] for c in "xyz"])
            # Differences of places know nothing of the centre
            turned = (start[own] - start[own][0]) @ rotation_about(vector("rotation")).T
            size = np.abs(turned).max()
            assert np.allclose(x[own] - x[own][0], turned, atol=1e-9 * size), f"{name}: {label}"
            followed += 1
            if label + "_spin_x" not in history or len(own) == 4:
                continue
            spin = np.cross(vector("spin"), x[own] - x[own][0])
            assert np.allclose(velocity[own] - velocity[own][0], spin,
                               atol=1e-9 * np.abs(velocity).max()), f"{name}: velocity of {label}"
    assert followed > len(names), f"{path}: no time is in the history"
    print(f"{path}: {len(files)} files, {len(names)} rigid bodies")


def main(arguments):
    """Check the files named on the command line."""
    partial = "--partial" in arguments
    hdf = None
    paths = [Path(name) for name in arguments if not name.startswith("--")]
    if not paths:
        sys.exit(__doc__)
    for path in sorted(paths, key=lambda path: path.suffix == ".pvd"):
        if path.suffix == ".pvd":
            check_series(path, partial, hdf)
            continue
        hdf = check_hdf(path, partial)
        surfaces = path.with_name(path.stem + "_rigid.pvd")
        if surfaces.exists():
            check_surfaces(surfaces, path)
        beside = path.with_suffix(".xdmf")
        assert partial or beside.exists(), f"there is no {beside}"
        if beside.exists():
            check_list(beside, path, partial)
        if "--pyvista" in arguments:
            check_pyvista(beside, path)


if __name__ == "__main__":
    main(sys.argv[1:])
