"""Which implementation solves: the compiled kernels, or numpy and LAPACK until they are compiled.

Compiling takes several seconds once per installation; numba keeps the result on disk. It is done in a child process, so
that requests are answered meanwhile, and the server changes over when the child is done.
"""

from __future__ import annotations

import atexit
import hashlib
import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Final

import msgspec
import numba
import numpy as np

from protocol.codec import decode, encode
from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold
from protocol.messages import Contacts, FrictionLaw, Grasps, Problem, Rubbing, ShapeRequest, Start
from protocol.scene import Cable

from . import numpy_path

CHOICES: Final = ("auto", "compiled", "numpy")
STAMP: Final = "kernels.stamp"  # beside numba's cache: what the code in it was compiled from, and whether all of it is
BEGUN, DONE = "begun", "done"


class Paths:
    """The implementation to use now; `kernels` is one of `CHOICES`."""

    def __init__(self, kernels: str) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self.current: ModuleType = numpy_path
        if kernels == "numpy":
            importlib.import_module("scipy.linalg")  # now, and not within the budget of the first request
            return
        if kernels == "compiled" or is_compiled():
            self.current = compile_kernels()
        else:
            # -P and our own folder: a folder named protocol where the user is must not come in between.
            folders = [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")]
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(folder for folder in folders if folder)}
            command = [sys.executable, "-P", "-m", "shape_server", "--compile"]
            atexit.register(self.close)  # a stop can come before the server's loop, which closes too
            self._child = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)

    @property
    def state(self) -> str:
        """One of "compiled", "compiling" and "numpy"."""
        if self._child is not None:
            return "compiling"
        return "numpy" if self.current is numpy_path else "compiled"

    def update(self) -> None:
        """Change over if the child has finished; with an error in the child, stay with numpy."""
        if self._child is not None and self._child.poll() is not None:
            done, self._child = self._child, None
            if done.returncode == 0:
                self.current = compile_kernels()

    def close(self) -> None:
        """End the child, if there is one; the next goes on from what it has put into the cache."""
        if self._child is not None:
            self._child.kill()
            self._child.wait()


def is_compiled() -> bool:
    """Whether numba's cache on disk holds all kernels as they are now."""
    return _stamp() == [_fingerprint(), DONE]


def forget_stale_kernels() -> None:
    """Delete compiled code of other sources: numba sees a change of a function's own file, but not of one that it calls.

    What was compiled from these sources stays, so that a compiler that was ended on its way goes on from there.
    """
    if _stamp()[:1] != [_fingerprint()]:
        for path in _cache().glob("*.nb[ic]"):
            path.unlink(missing_ok=True)
        _set_stamp(BEGUN)


def _stamp() -> list[str]:
    """The fingerprint that the code in the cache belongs to, and `BEGUN` or `DONE`; empty without any."""
    stamp = _cache() / STAMP
    return stamp.read_text(encoding="ascii").split() if stamp.is_file() else []


def _set_stamp(state: str) -> None:
    _cache().mkdir(parents=True, exist_ok=True)
    (_cache() / STAMP).write_text(f"{_fingerprint()} {state}\n", encoding="ascii")


def _cache() -> Path:
    from . import kernels

    return Path(str(kernels.settle.stats.cache_path))


def _fingerprint() -> str:
    """Hash of all that the compiled code is made from: the files with functions for numba, which import from each other only."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for source in compiled_files():
        digest.update(source.read_bytes())
    return digest.hexdigest()


def compiled_files() -> list[Path]:
    """The files of this package with functions that numba compiles, or that say how."""
    return [
        source
        for source in sorted(Path(__file__).parent.glob("*.py"))
        if b"\nfrom numba" in source.read_bytes() or b"\nfrom .jitted import" in source.read_bytes()
    ]


def compile_kernels() -> ModuleType:
    """The compiled kernels, after they have solved a small problem; from the cache on disk this takes 0.3 s.

    The problem has come out of a message, like every real one: numba compiles once more for arrays that are read-only.
    """
    from .solve import solve

    kernels = importlib.import_module(".kernels", __package__)
    forget_stale_kernels()
    request = decode(encode(sample()))
    assert isinstance(request, ShapeRequest)
    problem = request.problems[0]
    shape = solve(problem, request.gravity, tolerance=request.tolerance, path=kernels)
    start = Start(s=shape.s, frames=shape.frames, grasp_forces=shape.grasp_wrenches[:, :3].copy())
    warm = decode(encode(msgspec.structs.replace(request, problems=(msgspec.structs.replace(problem, start=start),))))
    assert isinstance(warm, ShapeRequest)
    solve(warm.problems[0], request.gravity, tolerance=request.tolerance, margin=True, path=kernels)
    free = msgspec.structs.replace(warm.problems[0], contacts=None)
    solve(free, request.gravity, tolerance=1e-9, path=kernels)  # of two meshes combined
    _set_stamp(DONE)
    return kernels


def sample() -> ShapeRequest:
    """What is solved to compile: a cable hanging between two clamps, with an edge under it, a bond, and a face that rubs."""
    along_x = np.sqrt(0.5) * np.array([0.0, 1.0, 0.0, 1.0])
    grasps = Grasps(
        s=np.array([0.0, 1.0]),
        position=np.array([[0.0, 0.0, 0.0], [0.8, 0.0, 0.0]]),
        quaternion=np.array([along_x, along_x]),
        hold=(Hold.CLAMP, Hold.CLAMP),
    )
    contacts = Contacts(
        s=np.array([0.45, 0.6, 0.75]),
        body=np.zeros(3, dtype=np.int64),
        feature=np.array([int(Feature.EDGE), int(Feature.FACE), int(Feature.FACE)]),
        point=np.array([[0.4, 0.0, -0.15], [0.55, 0.0, -0.2], [0.65, 0.0, -0.15]]),
        normal=np.tile([0.0, 0.0, 1.0], (3, 1)),
        direction=np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        extent=np.array([[-1.0, 1.0], [0.0, 0.0], [0.0, 0.0]]),
        distance=np.full(3, 0.01),
        friction=np.array([FRICTION_CODES.index(kind) for kind in (Friction.NONE, Friction.BOND, Friction.SIGNUM)]),
        force=np.zeros((3, 3)),
        rubbing=Rubbing(
            contact=np.array([2]),
            law=np.zeros(1, dtype=np.int64),
            s=np.array([0.75]),
            anchor=np.array([[0.65, 0.0, -0.14]]),
            laws=(FrictionLaw(coefficient=0.3),),
            time_step=0.1,
        ),
    )
    cable = Cable(name="sample", length=1.0, diameter=0.02, mass_per_length=0.1, bending=0.01, twist=0.01)
    problem = Problem(cable=cable, grasps=grasps, contacts=contacts)
    return ShapeRequest(session="warm-up", step=0, round=0, gravity=(0.0, 0.0, -9.81), tolerance=1e-2, problems=(problem,))
