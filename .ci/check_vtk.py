#!/usr/bin/env python3
"""Open results as other programs do and step through their times.

    check_vtk.py NAME.vtkhdf [NAME.pvd] [--partial]

The HDF5 file is read with h5py and with VTK's own reader, the .pvd series with VTK's XML reader;
where both are given their values must agree. --partial: the file's writer did not live to close it.
"""
import sys
import xml.etree.ElementTree as tree
from pathlib import Path

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader


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
        else:
            hdf = check_hdf(path, partial)


if __name__ == "__main__":
    main(sys.argv[1:])
