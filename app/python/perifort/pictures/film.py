"""Films: a picture of each output, one after the other."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Array = npt.NDArray[Any]


def image_of(figure: Figure, dpi: float = 130.0) -> Array:
    """A figure as pixels (height, width, 3), both even, as films want them."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    image = np.asarray(canvas.buffer_rgba())[:, :, :3]  # type: ignore[no-untyped-call]
    rows, columns = (2 * -(-n // 2) for n in image.shape[:2])
    even = np.full((rows, columns, 3), 255, dtype=np.uint8)
    even[:image.shape[0], :image.shape[1]] = image
    return even


def frames_per_second(outputs: int) -> float:
    """A film of some eight seconds, between 2 and 25 pictures a second."""
    return float(np.clip(outputs / 8.0, 2.0, 25.0))


def write_film(path: Path, outputs: int, draw: Callable[[int], Figure]) -> Path:
    """Write a film, mp4 or gif by its name, of figures that are all of one size."""
    if outputs < 2:
        raise ValueError(f"a film needs two outputs or more, there is {outputs}")
    frames = (image_of(draw(output)) for output in range(outputs))
    write = _write_gif if path.suffix == ".gif" else _write_mp4
    # Under another name until it is complete
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    write(part, frames, frames_per_second(outputs))
    part.replace(path)
    return path


def _write_gif(path: Path, frames: Iterable[Array], speed: float) -> None:
    """A gif, by the package that matplotlib writes its pictures with."""
    from PIL import Image
    images = [Image.fromarray(frame).quantize(256) for frame in frames]
    images[0].save(path, save_all=True, append_images=images[1:], duration=round(1000 / speed),
                   loop=0)


def _write_mp4(path: Path, frames: Iterable[Array], speed: float) -> None:
    """H.264 in mp4, which browsers and slides show."""
    try:
        import imageio_ffmpeg
    except ImportError as fault:
        raise ImportError("a film in mp4 needs the package imageio-ffmpeg: pip install "
                          "imageio-ffmpeg, or write a gif") from fault
    writer = None
    for frame in frames:
        if writer is None:
            writer = imageio_ffmpeg.write_frames(
                str(path), frame.shape[1::-1], fps=speed, codec="libx264", macro_block_size=2,
                quality=None, output_params=["-crf", "18", "-preset", "slow"])
            writer.send(None)
        writer.send(np.ascontiguousarray(frame))
    if writer is not None:
        writer.close()
