"""A motion as a film: the drawings of `figure` one after the other, as GIF (Pillow) or MP4 (ffmpeg)."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ncgen.errors import NcgenError
from ncgen.files import path_of, write_bytes
from ncgen.view.figure import drawn
from ncgen.view.scene import scene_of

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

RATE = 25
"""Pictures a second, as films in Europe have."""

MOST_PICTURES = 250
"""Pictures of a film; of longer motions every picture is shown for longer, so that a file stays small."""

RESOLUTION = 100
"""Dots per inch."""

SUFFIXES = (".gif", ".mp4")


def write_film(run: Trajectory, path: str | Path) -> Path:
    """Write a motion as it passes in time, by the ending of the name, and return the path.

    Raises NcgenError where Pillow or the program ffmpeg is missing, or the file cannot be written.
    """
    path = path_of(path)
    instants = film_instants(run.t)
    seconds = float(run.t[-1] - run.t[0]) / max(1, len(instants) - 1)
    data = _gif(run, instants, seconds) if path.suffix.lower() == ".gif" else _mp4(run, instants, seconds)
    return write_bytes(path, data)


def film_instants(t: np.ndarray) -> np.ndarray:
    """Return indices of the times (s) that become pictures: evenly spread in time, first and last among them."""
    count = int(min(MOST_PICTURES, max(2, round(RATE * float(t[-1] - t[0])) + 1)))
    return np.abs(t[:, None] - np.linspace(t[0], t[-1], count)).argmin(axis=0)


def _drawings(run: Trajectory, instants: np.ndarray) -> Iterator[Figure]:
    """The drawings, all of one size."""
    scene = scene_of(run)
    for instant in instants:
        yield drawn(scene, int(instant), f"{scene.name}, t = {scene.t[instant]:.2f} s", None)


def _png(chart: Figure) -> bytes:
    data = BytesIO()
    chart.savefig(data, format="png", dpi=RESOLUTION, metadata={"Software": None})
    return data.getvalue()


def _pixels(chart: Figure) -> np.ndarray:
    """Red, green and blue of a drawing, shape (height, width, 3)."""
    chart.set_dpi(RESOLUTION)
    canvas = FigureCanvasAgg(chart)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _gif(run: Trajectory, instants: np.ndarray, seconds: float) -> bytes:
    """A GIF that begins again at its end; seconds: of a picture."""
    try:
        image = import_module("PIL.Image")
    except ImportError as error:
        raise NcgenError("Pillow is not installed; pip install pillow, or write a .html") from error
    first, *others = (image.fromarray(_pixels(chart)).convert("P") for chart in _drawings(run, instants))
    data = BytesIO()
    first.save(data, format="GIF", save_all=True, append_images=others, duration=max(20, round(1000 * seconds)), loop=0)
    return data.getvalue()


def _mp4(run: Trajectory, instants: np.ndarray, seconds: float) -> bytes:
    """An MP4 by the program ffmpeg; seconds: of a picture."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise NcgenError("there is no program ffmpeg to write an .mp4; install it, or write a .gif or .html")
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"
    options = ["-vf", even, "-pix_fmt", "yuv420p", "-movflags", "frag_keyframe+empty_moov", "-f", "mp4", "-"]
    command = [program, "-loglevel", "error", "-f", "image2pipe", "-framerate", f"{1 / max(seconds, 1e-3):.6g}", "-i", "-", *options]
    done = subprocess.run(command, input=b"".join(map(_png, _drawings(run, instants))), capture_output=True)
    if done.returncode:
        message = " ".join(done.stderr.decode(errors="replace").split()) or f"exit code {done.returncode}"
        raise NcgenError(f"ffmpeg writes no film: {message}; write a .gif or .html")
    return done.stdout
