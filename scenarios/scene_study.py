"""What accuracy costs over a whole scene: a run by tolerance, time step and effect, against a run that is much finer.

No other program has these scenes, so the reference is our own: converged, not independent. Its tolerance is `FINER` times smaller than the
scene's and its time step half as long; where the ladder's own finest rung is not far from it, both agree, which is all that it can say.

The error of a time is the largest distance between the nodes of a run and those of the reference, at equal arc lengths, over all cables;
that of a run is below it in `USUAL` of the times that both have. The largest of all stands beside it in words: where a cable slips off an
edge or snaps, one run does so a step before the other, and they are far apart for that step whatever the tolerance. With friction and
bonds a posture is a matter of history, so that a longer time step is a real error.

How exact contacts are is no setting: they are looked at again until they agree with the shape; what one more round would change is in the
estimate, and in words below the plot.

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
from protocol.kinds import Outcome
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
EFFECT: Final = "effect left out"
OPTIONAL: Final = ("stretch", "natural_curvature", "bending_2", "micro_length", "bend_radius")  # numbers of a cable that ask for effects
USUAL: Final = 0.95  # of the times
SAME: Final = 1e-6  # s; times this near are one
LEAST: Final = 1e-3  # s; a run that took no more than its start

Told = Callable[[str], None]


@dataclass(frozen=True)
class Taken:
    """A run: its frames by time, and what they cost."""

    frames: dict[float, Frame]
    seconds: float  # of CPU
    ended: str = ""  # why it ended before its time

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
        """[m] What `USUAL` of the frames gave at most, with what one more round would change; None if a shape gave none."""
        errors = [
            [None if shape.error is None else shape.error + more for shape, more in zip(frame.shapes, frame.coupling, strict=True)]
            for frame in self.frames.values()
        ]
        if any(error is None for frame in errors for error in frame):
            return None
        return usual([max(error for error in frame if error is not None) for frame in errors])

    @property
    def contacts(self) -> str:
        """How far contacts and shapes disagree, in words."""
        more = [max(frame.coupling) for frame in self.frames.values() if frame.coupling]
        return (
            "How exact contacts are is no setting: they are looked at again until they agree with the shape. At the end of a step, one "
            f"more round would move {USUAL:.0%} of the postures by less than {1e6 * usual(more):.2g} um, and none by more than "
            f"{1e6 * max(more):.2g} um, as estimated."
        )


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
    rows, known, largest, lost = [], dict[Scene, Taken](), list[str](), list[str]()
    for group, setting, changed in _settings(plain):
        told(f"{name}: {group} {setting}")
        taken = known[changed] if changed in known else known.setdefault(changed, _run(changed, name, show))
        if taken.ended:
            lost.append(f"{group} {setting}: left out, for that run ends before its time: {taken.ended}")
            continue
        away = apart(taken.frames, reference.frames)
        largest.append(f"{1e3 * max(away):.2g} mm ({setting})")
        estimate = None if taken.estimate is None else taken.estimate / length
        rows.append(
            {
                "group": group,
                "setting": setting,
                "error": usual(away) / length,
                "estimate": estimate,
                "seconds": max(taken.seconds - begin.seconds, LEAST),
                "nodes": taken.nodes,
                "factorisations": taken.factorisations,
                "model": "run",
            }
        )
    remarks = (
        f"Errors and estimates are those of {USUAL:.0%} of the times. The largest of all errors were {', '.join(largest)}.",
        known[plain].contacts,
        f"The reference is our own run with a tolerance of {1e3 * scene.tolerance / FINER:g} mm and steps of {scene.time_step / 2:g} s: "
        "converged, not independent. Estimates are of each step alone, without what the steps before have done to it.",
        *lost,
    )
    return {"name": name, "title": scene.title, "measured": "a whole run, all three programs", "rows": rows, "remarks": list(remarks)}


def apart(run: dict[float, Frame], reference: dict[float, Frame]) -> list[float]:
    """Largest distance [m] between two runs at each time that both have, at the nodes of the first."""
    times = sorted(reference)
    distances = []
    for time, frame in run.items():
        near = min(range(len(times)), key=lambda k, time=time: abs(times[k] - time))  # type: ignore[misc]
        if abs(times[near] - time) > SAME:
            continue
        worst = 0.0
        for own, exact in zip(frame.shapes, reference[times[near]].shapes, strict=True):
            there = np.column_stack([np.interp(own.s, exact.s, column) for column in exact.nodes.T])
            worst = max(worst, float(np.linalg.norm(own.nodes - there, axis=1).max(initial=0.0)))
        distances.append(worst)
    return distances


def usual(values: Sequence[float]) -> float:
    """What `USUAL` of some values do not exceed."""
    return float(np.quantile(values, USUAL, method="higher"))


def _settings(scene: Scene) -> Iterator[tuple[str, str, Scene]]:
    for times in TOLERANCES:
        yield AUTOMATIC, f"{1e3 * times * scene.tolerance:g} mm", replace(scene, tolerance=times * scene.tolerance)
    for times in TIME_STEPS:
        yield TIME_STEP, f"{times * scene.time_step:g} s", replace(scene, time_step=times * scene.time_step)
    for number in OPTIONAL:
        if any(getattr(cable, number) is not None for cable in scene.cables):
            without = tuple(replace(cable, **{number: None}) for cable in scene.cables)  # type: ignore[arg-type]
            yield EFFECT, f"without {number}", replace(scene, cables=without)


def _run(scene: Scene, name: str, show: Display) -> Taken:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory(prefix="cablecosim-") as folder:
        ended = launch(scene, name, show, out=Path(folder) / name, kernels="compiled", replay=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        frames = recording.read(ended.folder / recording.FILE_NAME).frames
        kept = {round(frame.time, 9): frame for frame in frames if not frame.relaxation}
        why = next((shape.sentence for frame in frames for shape in frame.shapes if shape.outcome is not Outcome.CONVERGED), "")
    return Taken(kept, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, why)
