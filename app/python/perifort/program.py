"""Starting the program."""
from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Union

from .results import Results
from .scene import Scene

PathLike = Union[str, "os.PathLike[str]"]

STATUSES = {1: "the scene or the environment is at fault", 2: "wrong command line",
            3: "no valid answer: unstable or not converged", 4: "interrupted with a checkpoint",
            130: "interrupted"}


class RunError(RuntimeError):
    """A run that ended without an answer: `message` is what the program said, `status` its exit
    status (1: scene or environment at fault, 2: wrong command line, 3: unstable or not converged,
    4: stopped with a checkpoint).
    """

    def __init__(self, status: int, message: str, command: list[str]) -> None:
        self.status, self.message, self.command = status, message, command
        meaning = STATUSES.get(status, "signal" if status < 0 else "unknown")
        super().__init__(f"perifort ended with status {status} ({meaning})\n{message}".rstrip())


def find_program(program: PathLike | None = None) -> Path:
    """The program: the argument, else what $PERIFORT names, `perifort` on PATH, or the one that
    ./pf has built in the project this package lies in. FileNotFoundError if there is none.
    """
    for given, source in ((program, "argument"), (os.environ.get("PERIFORT"), "$PERIFORT")):
        if given:
            path = Path(given)
            if path.is_file() and os.access(path, os.X_OK):
                return path.resolve()
            raise FileNotFoundError(f"{path} is no program ({source})")
    on_path = shutil.which("perifort")
    if on_path:
        return Path(on_path)
    root = Path(__file__).resolve().parents[3]
    built = root / "build" / "bin" / "optimised" / "perifort"
    if built.is_file():
        return built
    raise FileNotFoundError("the program perifort was not found: build it with ./pf version and "
                            "name it by program=..., by the environment variable PERIFORT, or put it "
                            f"on PATH (looked for {built}, too)")


def run(scene: Scene | PathLike, folder: PathLike | None = None, *, threads: int | None = None,
        progress: bool | Callable[[str], None] = True, overwrite: bool = False,
        program: PathLike | None = None, arguments: tuple[str, ...] = ()) -> Results:
    """Run a scene, or the scene in a file, and return its results.

    They go to `folder`, by default out/ and the name of the scene; results that are there are an
    error unless `overwrite` is set. A Scene is written there first. `threads`: None leaves their
    number to the program. `progress` shows a line with percent, step and speed, or gives each such
    line to a function. Further `arguments` go to the program: ("--max-minutes", "5").

    A RunError has the program's message and exit status. An interrupt (Ctrl-C) is passed on to the
    program, which stops with a checkpoint.
    """
    path = find_program(program)
    if isinstance(scene, Scene):
        folder = Path("out") / scene.name if folder is None else Path(folder)
        file = scene.files_from(scene.folder).write(folder / f"{scene.name}.nml")
    else:
        file = Path(scene)
        folder = Path("out") / file.stem if folder is None else Path(folder)
    command = [str(path), "run", str(file), "--output", str(folder), *arguments]
    if threads is not None:
        command += ["--threads", str(threads)]
    if overwrite:
        command.append("--overwrite")
    if not progress:
        command.append("--quiet")
    status, message = _watch(command, progress)
    if status != 0:
        raise RunError(status, message, command)
    return Results(folder / f"{file.stem}.vtkhdf")


def _watch(command: list[str], progress: bool | Callable[[str], None]) -> tuple[int, str]:
    """Run a command; its exit status and what it wrote to standard error."""
    output, given = _terminal() if progress else (-1, subprocess.DEVNULL)
    try:
        process = subprocess.Popen(command, stdout=given, stderr=subprocess.PIPE, text=True,
                                   encoding="utf-8", errors="replace",
                                   # An interrupt at the terminal would reach it twice
                                   start_new_session=True)
    finally:
        if given >= 0:
            os.close(given)
    assert process.stderr is not None
    said: list[str] = []
    reader = threading.Thread(target=lambda stream: said.append(stream.read()), daemon=True,
                              args=(process.stderr,))
    reader.start()
    try:
        try:
            _show(output, progress)
            status = process.wait()
        except KeyboardInterrupt:
            # The program writes a checkpoint and ends with status 4
            process.send_signal(signal.SIGINT)
            _show(output, progress is True)
            status = process.wait()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        if output >= 0:
            os.close(output)
        reader.join()
        process.stderr.close()
    message = "".join(said).strip()
    # Warnings of a run that went well are no error, but must be seen
    if status == 0 and message and progress:
        print(message, file=sys.stderr)
    return status, message


def _terminal() -> tuple[int, int]:
    """Two ends of a terminal, to read from and to write to: on one the program shows its progress
    several times a second, in a log every ten seconds. Where there are none, those of a pipe.
    """
    try:
        return os.openpty()
    except (AttributeError, OSError):
        return os.pipe()


def _show(output: int, progress: bool | Callable[[str], None]) -> None:
    """Show the program's lines of progress, one over the other, until it has closed its output."""
    shown, rest = False, ""
    while output >= 0:
        try:
            read = os.read(output, 4096)
        except OSError:
            # So a terminal tells that its other end is closed
            read = b""
        *lines, rest = re.split(r"[\r\n]+", rest + read.decode("utf-8", errors="replace"))
        if not read:
            lines.append(rest)
        for line in lines:
            text = re.sub(r"\x1b\[K", "", line).strip()
            if not re.match(r"\d+(\.\d+)? %", text):
                continue
            if callable(progress):
                progress(text)
            elif progress:
                print(f"\r{text:<79}", end="", flush=True)
                shown = True
        if not read:
            break
    if shown:
        print(flush=True)
