"""Surfaces drawn by pyvista, off screen."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .colours import Colours
    from .fields import Camera

Array = npt.NDArray[Any]


def render(quads: Array, values: Array, colours: Colours,
           camera: Camera) -> tuple[Array, tuple[float, float, float, float]]:
    """An image of faces (n, 4, 3), and what it covers in the plane of the camera (left, right,
    bottom, top).
    """
    try:
        import pyvista
    except ImportError as fault:
        raise ImportError("this way of drawing needs the package pyvista: pip install pyvista, or "
                          "leave out render") from fault
    from vtkmodules.vtkCommonCore import vtkLogger
    # Without a screen vtk draws in memory, and warns of that
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    # Lengths of about 1, since the renderer thinks in single precision
    flat = camera.flat(quads).reshape(-1, 2)
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = float((high - low).max())
    middle = quads.reshape(-1, 3).mean(axis=0)
    points = (quads.reshape(-1, 3) - middle) / size
    faces = np.column_stack([np.full(len(quads), 4), np.arange(4 * len(quads)).reshape(-1, 4)])
    mesh = pyvista.PolyData(points, faces.ravel())
    mesh.cell_data["values"] = values
    # Faces share corners, so that the light on a smooth surface is smooth
    mesh = mesh.clean(tolerance=1e-6)
    pixels = 1200
    shape = np.maximum((pixels * (high - low) / size).astype(int), 60)
    plotter = pyvista.Plotter(off_screen=True, window_size=[int(n) for n in shape],
                              lighting="three lights")
    plotter.set_background("white")
    plotter.add_mesh(mesh, scalars="values", cmap=colours.map, clim=(colours.low, colours.high),
                     show_scalar_bar=False, smooth_shading=True, split_sharp_edges=True,
                     feature_angle=40.0, ambient=0.25, diffuse=0.75, specular=0.1,
                     nan_color="lightgrey")
    plotter.enable_parallel_projection()
    centre = (0.5 * (low + high) - camera.flat(middle)) / size
    focus = centre[0] * camera.right + centre[1] * camera.up
    plotter.camera.focal_point = tuple(focus)
    plotter.camera.position = tuple(focus + 10.0 * camera.eye)
    plotter.camera.up = tuple(camera.up)
    plotter.camera.parallel_scale = 0.5 * float(high[1] - low[1]) / size
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return image, (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
