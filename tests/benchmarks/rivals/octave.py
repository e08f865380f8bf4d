"""What a student wrote in the paper's own language: handwritten.m in an example's folder, run by Octave where it is installed."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from pathlib import Path

from ncgen.comparisons.rivals.base import handwritten
from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.resources import folder

PROGRAM = "octave-cli"
LONGEST = 600.0
"""Seconds after which it is given up."""


def available(kernels: Kernels) -> bool:
    """Whether the example has a handwritten.m and Octave is there to run it."""
    module = handwritten(kernels)
    if module is None or module.__file__ is None:
        return False
    return Path(module.__file__).with_suffix(".m").is_file() and shutil.which(PROGRAM) is not None


def falls(kernels: Kernels, *, duration: float, steps: int, rtol: float, atol: float) -> list[dict]:
    """What handwritten.m prints: tool, seconds, psi (the angles at the end) and evaluations of every integrator.

    duration: s; steps: of RK4; rtol, atol: of ode45
    Raises NcgenError with Octave's last line if it fails, and for a model without hand-written functions.
    """
    module = handwritten(kernels)
    if module is None:
        raise NcgenError(f"{kernels.name}: there are no hand-written functions for it; choose robot")
    data = module.data(kernels.q0) | {"duration": duration, "steps": steps, "rtol": rtol, "atol": atol}
    with tempfile.TemporaryDirectory() as work:
        path = Path(work) / f"{kernels.name}.json"
        path.write_text(json.dumps(data), encoding="utf-8")
        call = [PROGRAM, "--no-init-file", "--quiet", "--path", str(folder("examples") / kernels.name), "--eval", f"handwritten('{path}')"]
        try:
            done = subprocess.run(call, capture_output=True, text=True, timeout=LONGEST, check=False)
        except subprocess.TimeoutExpired:
            raise NcgenError(f"{PROGRAM}: not ready after {LONGEST:g} s") from None
    if done.returncode:
        raise NcgenError(f"{PROGRAM}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")
    return json.loads(done.stdout)
