"""Files of all kinds but models in TOML, damaged at random, and what becomes of them: `python mutated_data.py NUMBER …` shows some.

A number says everything: the format, the file that is damaged and how. Robots in URDF, SDF and MJCF, studies, tables, loops, motions, parts
of studies, manifests and meshes.
"""

from __future__ import annotations

import io
import random
import re
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

import ncgen
from ncgen.archives import UNREADABLE_ERRORS
from ncgen.exchange.examples import load
from ncgen.exchange.robots import read_robot
from ncgen.studies.file import read_study
from ncgen.view.meshes import mesh_of

ROBOTS = Path(__file__).parent.parent / "robots"

STUDY = """model = "pendulum"
keep = ["B.x", "max(B.x)", "history(B.y)"]
times = [0.05, 0.1]
design = "sobol"
count = 16
seed = 3
[vary]
"start(B.x)" = { low = -1.0, high = -0.9 }
[simulation]
duration = 0.1
rtol = 1e-6
"""

LOOPS = '[[connect]]\nname = "tip"\nparent = "a"\nchild = "b"\npoint = [0.1, 0.0, 0.0]\n[[weld]]\nparent = "b"\nchild = "c"\n'

CHAIN = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="c"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="c"/></joint></robot>
"""

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"

STL = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"

WILD = (
    b"", b"0", b"-1", b"1e300", b"1e-300", b"nan", b"inf", b"9" * 400, b"10000000000", b"\0", b"\xff", b"[", b"]]", b"{", b"<a>", b"</",
    b'"', b"'", b"\n", b"=", b"true", b"../..", b"/dev/zero", b"ground", b"\xf0\x9f\xa6\xbe",
)  # fmt: skip
"""What is put in the place of a word."""


def _npz(**members: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **members)
    return buffer.getvalue()


@cache
def originals() -> dict[str, bytes]:
    """{file's name: bytes} of whole files; what begins with a name before a slash lies in a folder."""
    found = {
        path.name: path.read_bytes()
        for path in (ROBOTS / "crane.urdf", ROBOTS / "fourbar.sdf", ROBOTS / "gantry.xml", ROBOTS / "fourbar.xml")
    }
    with tempfile.TemporaryDirectory() as place:
        kernels = ncgen.compile(load("pendulum"), "numpy")
        found["run.npz"] = ncgen.simulate(kernels, 0.1, points=5).to_npz(Path(place) / "run.npz").read_bytes()
        study = Path(place) / "study"
        ncgen.study(load("pendulum"), {"start(B.x)": [-1.0, -0.9]}, keep="B.x", duration=0.05, folder=study)
        found |= {f"study/{path.name}": path.read_bytes() for path in study.iterdir() if path.stat().st_size}
    texts = {"study.toml": STUDY, "table.csv": "start(B.x)\n-1.0\n-0.9\n", "r.loops.toml": LOOPS, "m.obj": OBJ, "m.stl": STL}
    return found | {name: text.encode() for name, text in texts.items()}


def mutated(number: int) -> tuple[str, bytes]:
    """(name, bytes) of a damaged file."""
    chance, files = random.Random(number), originals()
    name = chance.choice([*files])
    data = files[name]
    for _ in range(chance.randint(1, 4)):
        data = chance.choice(CHANGES)(data, chance)
    return name, data


# -- damage ---------------------------------------------------------------------------------------------------------------------


def _flip(data: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(data) + 1)
    return data[:place] + bytes([chance.randrange(256)]) + data[place + 1 :]


def _cut(data: bytes, chance: random.Random) -> bytes:
    first, last = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return chance.choice((data[:first], data[last:], data[:first] + data[last:]))


def _again(data: bytes, chance: random.Random) -> bytes:
    first, last = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return data[:last] + data[first:last] * chance.choice((1, 1, 3, 50)) + data[last:] if last - first < 20_000 else data


def _word(data: bytes, chance: random.Random) -> bytes:
    words = [*re.finditer(rb"[\w.+-]+", data)]
    if not words:
        return chance.choice(WILD)
    found = chance.choice(words)
    return data[: found.start()] + chance.choice((*WILD, chance.choice(words)[0])) + data[found.end() :]


def _number(data: bytes, chance: random.Random) -> bytes:
    words = [*re.finditer(rb"-?\d+\.?\d*", data)]
    if not words:
        return data
    found = chance.choice(words)
    return data[: found.start()] + chance.choice(WILD[:9]) + data[found.end() :]


def _member(data: bytes, chance: random.Random) -> bytes:
    """An archive with right checksums and a member that is something else; other files as they are."""
    if not zipfile.is_zipfile(io.BytesIO(data)):
        return data
    try:
        members = dict(np.load(io.BytesIO(data)))
    except UNREADABLE_ERRORS:  # an earlier change has damaged it
        return data
    name = chance.choice([*members])
    value = members[name]
    changed = [
        value[:-1] if value.ndim else value, np.repeat(value, 3), value[..., None], value.astype(str), np.array(3.0), np.array([]),
        np.full(value.shape, np.nan), np.full(value.shape, "x"), np.zeros((0, 5)), value.astype("S"), np.full(value.shape, 1e300),
    ]  # fmt: skip
    members[name] = chance.choice(changed)
    if chance.random() < 0.2:
        del members[name]
    return _npz(**members)


CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (_flip, _cut, _again, _word, _word, _number, _number, _number, _member)


# -- what becomes of it -----------------------------------------------------------------------------------------------------------


def outcome(number: int, folder: Path) -> str:
    """ "refused" or "accepted" for a file that is dealt with as it should be, otherwise what is wrong."""
    name, data = mutated(number)
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    if "/" in name:
        for other, whole in originals().items():
            if other.startswith(name.partition("/")[0] + "/"):
                (folder / other).write_bytes(whole)
    path.write_bytes(data)
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                _read(path, folder)
            except ncgen.NcgenError as error:
                said = str(error)
                return "refused" if 10 < len(said) <= 300 and said.isprintable() else f"message {said!r}"
        bad = [str(one.message) for one in told if issubclass(one.category, RuntimeWarning) or "\n" in str(one.message)]
        return f"warning {bad[0]!r}" if bad else "accepted"
    except Exception:
        return traceback.format_exc()
    finally:
        path.unlink()


def _read(path: Path, folder: Path) -> None:
    """As a user does, to numbers."""
    if path.parent != folder:
        result = ncgen.read(path.parent)
        result.table()
        str(result.complete)
        return
    if path.name == "table.csv":
        (folder / "listed.toml").write_text('model = "pendulum"\nkeep = ["B.x"]\nvary = "table.csv"\n[simulation]\nduration = 0.1\n')
        read_study(folder / "listed.toml")
    elif path.name == "r.loops.toml":
        (folder / "r.urdf").write_text(CHAIN)
        load(folder / "r.urdf", loops=path)
    elif path.suffix == ".toml":
        read_study(path)
    elif path.suffix == ".npz":
        found = ncgen.read(path)
        repr(found)
    elif path.suffix in (".obj", ".stl"):
        mesh_of(path)
    else:
        read_robot(path)
        load(path, limits=True, friction=True)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        print(*mutated(int(argument)))
        with tempfile.TemporaryDirectory() as place:
            print("\n----", outcome(int(argument), Path(place)))
