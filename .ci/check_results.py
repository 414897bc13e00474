"""Hold a results folder to what the user guide promises: names, kinds and lengths of all that h5py
finds.

    check_results.py NAME.vtkhdf

What VTK makes of the file is the matter of check_vtk.py.
"""
import csv
import sys
from pathlib import Path

import h5py
import numpy as np

HISTORY = ["step", "time", "kinetic_energy", "strain_energy", "dissipated_energy", "external_work",
           "broken_bonds", "maximum_damage", "step_size"]


def require(condition, message):
    if not condition:
        sys.exit(f"check_results: {message}")


def read_with_h5py(path):
    """Points, times, {name: values of every step}, and the checks of all else."""
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        kind = root.attrs["Type"]
        require((kind.decode() if isinstance(kind, bytes) else kind) == "PolyData", f"type {kind}")
        require(list(root.attrs["Version"]) == [2, 0], "layout version")
        points = root["Points"][()]
        n = len(points)
        require(points.shape == (n, 3) and n > 0, f"points have the shape {points.shape}")
        require(list(root["NumberOfPoints"][()]) == [n], "NumberOfPoints")
        steps = root["Steps"]
        count = int(steps.attrs["NSteps"])
        times = steps["Values"][:count]
        require(count >= 2, f"{count} steps are no time series")
        require(len(times) == count and np.all(np.diff(times) > 0), f"times {times}")
        require(not np.any(steps["PointOffsets"][:count]), "points are written once")
        fields = {}
        for name, data in root["PointData"].items():
            offsets = steps["PointDataOffsets"][name][:count]
            require(list(offsets) == [k * n for k in range(count)], f"offsets of {name}")
            require(data.shape[0] >= count * n, f"{name} has {data.shape[0]} rows")
            values = data[:count * n]
            require(np.all(np.isfinite(values)), f"{name} is not finite")
            fields[name] = values.reshape(count, n, *values.shape[1:])
        require(len(fields) > 0, "no field was written")

        volume = file["points/volume"][()]
        require(volume.shape == (n,) and volume.dtype == np.float64 and np.all(volume > 0),
                "volume")
        for name in ("body", "material", "layer"):
            data = file["points"][name]
            require(data.shape == (n,) and data.dtype == np.int32, f"/points/{name}")
        for name in ("text", "command"):
            require(name in file["scene"], f"/scene/{name}")
        for name in ("version", "compiler"):
            require(name in file["scene"].attrs, f"attribute {name} of /scene")
        check_history(path, file["history"])
    return points, times, fields


def check_history(path, group):
    """All columns are there, of one length, with units, finite, and the same in the .csv file."""
    columns = {name: data[()] for name, data in group.items()}
    for name in HISTORY:
        require(name in columns, f"/history/{name} is missing")
    rows = len(columns["step"])
    require(rows >= 2 and columns["step"][0] == 0, "history rows")
    for name, values in columns.items():
        require(len(values) == rows, f"/history/{name} has {len(values)} of {rows} rows")
        require("units" in group[name].attrs, f"/history/{name} has no units")
        require(np.all(np.isfinite(values)), f"/history/{name} is not finite")
    require(np.all(np.diff(columns["step"]) > 0), "history steps do not rise")
    with open(Path(path).with_name("history.csv"), newline="", encoding="utf-8") as table:
        lines = [line for line in csv.reader(table) if line and not line[0].startswith("#")]
    header, body = [name.strip() for name in lines[0]], lines[1:]
    require(len(body) == rows, f"history.csv has {len(body)} of {rows} rows")
    for at, name in enumerate(header):
        name = name.split(" ")[0].split("[")[0]
        require(name in columns, f"history.csv has a column '{name}' of its own")
        written = np.array([float(line[at]) for line in body])
        require(np.allclose(written, columns[name], rtol=1e-14, atol=0), f"history.csv: {name}")
    require(len(header) == len(columns), "history.csv lacks columns")


def main():
    path = Path(sys.argv[1])
    require(path.is_file(), f"{path} is not there")
    points, times, fields = read_with_h5py(path)
    print(f"{path.name}: {len(points)} points, {len(times)} steps, {', '.join(sorted(fields))}: "
          "all is where it should be")


if __name__ == "__main__":
    main()
