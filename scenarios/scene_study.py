"""What accuracy costs over a whole scene: a run by tolerance and by time step, against a run that is much finer in both.

No other program has these scenes, so the reference is our own: converged, not independent. Its tolerance is `FINER` times smaller than the
scene's and its time step half as long; where the ladder's own finest rung is not far from it, both agree, which is all that it can say.

The error is the largest distance between the nodes of a run and those of the reference, at equal arc lengths and equal times: at every
time that both have, over all cables. With friction and bonds a posture is a matter of history, so that a longer time step is a real error.
Time is CPU time of all three programs, without pictures and page, less that of a run of one step, which is their start.
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from protocol import recording
from protocol.messages import Frame
from protocol.scene import Scene

from .launch import launch
from .load import load, scene_name
from .progress import Display, display

FINER: Final = 8.0  # times, tolerance of the reference
TOLERANCES: Final = (8.0, 4.0, 2.0, 1.0, 0.5)  # times the scene's
TIME_STEPS: Final = (4.0, 2.0, 1.0)  # times the scene's
AUTOMATIC: Final = "tolerance, automatic"  # as in the report of `shape_server.accuracy`, whose rows these become
TIME_STEP: Final = "time step"
SAME: Final = 1e-6  # s; times this near are one
LEAST: Final = 1e-3  # s; a run that took no more than its start

Told = Callable[[str], None]


@dataclass(frozen=True)
class Taken:
    """A run: its frames by time, and what they cost."""

    frames: dict[float, Frame]
    seconds: float  # of CPU

    @property
    def nodes(self) -> int:
        """Of all cables, at most."""
        return max(sum(len(shape.s) for shape in frame.shapes) for frame in self.frames.values())

    @property
    def factorisations(self) -> int:
        """Of all steps."""
        return sum(shape.cost.factorisations for frame in self.frames.values() for shape in frame.shapes)

    @property
    def estimate(self) -> float | None:
        """[m] The largest that any shape gave for itself; None if one gave none."""
        errors = [shape.error for frame in self.frames.values() for shape in frame.shapes]
        return None if any(error is None for error in errors) else max(error for error in errors if error is not None)


def study_scenes(names: Sequence[str]) -> list[dict[str, Any]]:
    """`study_scene` of built-in scenes or files, with its progress shown."""
    show = display()
    try:
        return [study_scene(load(name), scene_name(name), show, show.say) for name in names]
    finally:
        show.close()


def study_scene(scene: Scene, name: str, show: Display, told: Told) -> dict[str, Any]:
    """Run a scene at every setting; its rows in plain values, as `shape_server.accuracy study --measured` takes them."""
    plain = replace(scene, pictures=())
    told(f"{name}: reference")
    reference = _run(replace(plain, tolerance=scene.tolerance / FINER, time_step=scene.time_step / 2), name, show)
    begin = _run(replace(plain, moves=(replace(scene.moves[0], duration=scene.time_step),)), name, show)
    length = max(cable.length for cable in scene.cables)
    rows, known = [], dict[tuple[float, float], Taken]()
    for group, setting, changed in _settings(plain):
        told(f"{name}: {group} {setting}")
        key = changed.tolerance, changed.time_step
        taken = known[key] if key in known else known.setdefault(key, _run(changed, name, show))
        estimate = None if taken.estimate is None else taken.estimate / length
        rows.append(
            {
                "group": group,
                "setting": setting,
                "error": apart(taken.frames, reference.frames) / length,
                "estimate": estimate,
                "seconds": max(taken.seconds - begin.seconds, LEAST),
                "nodes": taken.nodes,
                "factorisations": taken.factorisations,
                "model": "run",
            }
        )
    remark = (
        f"The reference is our own run with a tolerance of {1e3 * scene.tolerance / FINER:g} mm and steps of {scene.time_step / 2:g} s: "
        "converged, not independent. Estimates are of each shape alone, without what the steps before have done to it."
    )
    return {"name": name, "title": scene.title, "measured": "a whole run, all three programs", "rows": rows, "remarks": [remark]}


def apart(run: dict[float, Frame], reference: dict[float, Frame]) -> float:
    """Largest distance [m] between two runs, at the nodes of the first, at all times that both have."""
    times = sorted(reference)
    worst = 0.0
    for time, frame in run.items():
        near = min(range(len(times)), key=lambda k, time=time: abs(times[k] - time))  # type: ignore[misc]
        if abs(times[near] - time) > SAME:
            continue
        for own, exact in zip(frame.shapes, reference[times[near]].shapes, strict=True):
            there = np.column_stack([np.interp(own.s, exact.s, column) for column in exact.nodes.T])
            worst = max(worst, float(np.linalg.norm(own.nodes - there, axis=1).max(initial=0.0)))
    return worst


def _settings(scene: Scene) -> Iterator[tuple[str, str, Scene]]:
    for times in TOLERANCES:
        yield AUTOMATIC, f"{1e3 * times * scene.tolerance:g} mm", replace(scene, tolerance=times * scene.tolerance)
    for times in TIME_STEPS:
        yield TIME_STEP, f"{times * scene.time_step:g} s", replace(scene, time_step=times * scene.time_step)


def _run(scene: Scene, name: str, show: Display) -> Taken:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory(prefix="cablecosim-") as folder:
        ended = launch(scene, name, show, out=Path(folder) / name, kernels="compiled", replay=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        frames = recording.read(ended.folder / recording.FILE_NAME).frames
        kept = {round(frame.time, 9): frame for frame in frames if not frame.relaxation}
    return Taken(kept, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
