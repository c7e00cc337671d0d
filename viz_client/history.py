"""What a run came to, step by step, from its recording alone: curves over the simulated time, each with a sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol import recording
from protocol.kinds import Outcome
from protocol.messages import Frame, Shape
from protocol.scene import Cable

UNKNOWN: Final = float("nan")


@dataclass(frozen=True)
class Curve:
    """A number of every step; NaN where it is not known."""

    name: str
    y: np.ndarray  # (k,)


@dataclass(frozen=True)
class Panel:
    """Curves that share an axis, what they may not pass, and what they say in words."""

    label: str  # of the axis, with its unit
    curves: tuple[Curve, ...]
    sentence: str
    is_logarithmic: bool = False  # where it runs over more than a decade
    limit: tuple[str, float] | None = None  # name and value of a line


@dataclass(frozen=True)
class History:
    """The steps of a run."""

    time: np.ndarray  # (k,) s, simulated
    moves: tuple[tuple[str, float], ...]  # name and begin [s] of every move
    panels: tuple[Panel, ...]


def history(run: recording.Recording) -> History:
    """The curves of a run, without the frames that are shown on the way from one equilibrium to the next."""
    steps = _Steps(run)
    panels = (_errors, _forces, _bends, _contacts, _misses, _torques)
    drawn = tuple(panel for make in panels if (panel := make(steps)) is not None) if len(steps.time) else ()
    return History(steps.time, steps.moves, drawn)


class _Steps:
    """Numbers gathered frame by frame, so that a long run needs little memory."""

    def __init__(self, run: recording.Recording) -> None:
        self.scene = run.snapshot.scene
        self._numbers: dict[str, list[float]] = {}
        times: list[float] = []
        moves: list[tuple[str, float]] = []
        for frame in run.frames:
            if frame.relaxation:
                continue
            times.append(frame.time)
            if not moves or moves[-1][0] != frame.move:
                moves.append((frame.move, frame.time))
            self._add(frame)
        self.time, self.moves = np.array(times), tuple(moves)

    def _add(self, frame: Frame) -> None:
        for index, (cable, shape) in enumerate(zip(self.scene.cables, frame.shapes, strict=True)):
            for name, read in _OF_A_SHAPE.items():
                more = frame.coupling[index] if name == "error" and frame.coupling else 0.0
                self._keep(f"{name} {cable.name}", read(shape) + more if shape.outcome is Outcome.CONVERGED else UNKNOWN)
        self._keep("contacts", len(frame.touching.s))
        self._keep("rounds", frame.rounds)
        self._keep("penetration", frame.penetration)
        self._keep("grasp error", frame.grasp_error)
        self._keep("torque", frame.torque_ratio)

    def _keep(self, name: str, value: float) -> None:
        self._numbers.setdefault(name, []).append(float(value))

    def curve(self, name: str, key: str, factor: float = 1.0) -> Curve:
        """A number of the frame, in another unit."""
        return Curve(name, factor * np.array(self._numbers[key]))

    def curves(self, name: str, key: str, factor: float = 1.0) -> tuple[Curve, ...]:
        """A number of every cable; named after it if there are several."""
        several = len(self.scene.cables) > 1
        return tuple(self.curve(f"{name}, {cable.name}" if several else name, f"{key} {cable.name}", factor) for cable in self.scene.cables)


_OF_A_SHAPE: Final[dict[str, Callable[[Shape], float]]] = {
    "error": lambda shape: shape.error if shape.error is not None else UNKNOWN,
    "tension": lambda shape: float(shape.tension.max(initial=0.0)),
    "grasp": lambda shape: _largest(shape.grasp_wrenches[:, :3]),
    "contact": lambda shape: _largest(shape.contact_forces),
    "radius": lambda shape: 1.0 / most if (most := float(np.abs(shape.curvature).max(initial=0.0))) > 0.0 else UNKNOWN,
}


def _largest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


def _errors(steps: _Steps) -> Panel:
    tolerance = 1e3 * steps.scene.tolerance
    curves = steps.curves("error estimate", "error", 1e3)
    above = sum(int((~(curve.y <= tolerance)).sum()) for curve in curves)
    said = "in every step within" if above == 0 else f"above, or not known, in {above} of {sum(len(curve.y) for curve in curves)} shapes:"
    what = "How far the nodes may be from where they belong, with what one more round would change."
    sentence = f"{what} {_extreme(steps, curves, 'mm', np.nanargmax)}; {said} the tolerance."
    return Panel("error estimate [mm]", curves, sentence, is_logarithmic=True, limit=("tolerance", tolerance))


def _forces(steps: _Steps) -> Panel:
    curves = (*steps.curves("tension", "tension"), *steps.curves("gripper", "grasp"), *steps.curves("contact", "contact"))
    sentence = f"The largest tension, force at a gripper and force of a contact. {_extreme(steps, curves, 'N', np.nanargmax)}."
    return Panel("largest force [N]", curves, sentence)


def _bends(steps: _Steps) -> Panel | None:
    curves = steps.curves("bend radius", "radius", 1e3)
    if all(np.isnan(curve.y).all() for curve in curves):
        return None
    least = [cable.bend_radius for cable in steps.scene.cables if cable.bend_radius is not None]
    limit = ("bend_radius", 1e3 * max(least)) if least else None
    sentence = f"Where each cable is bent most. {_extreme(steps, curves, 'mm', np.nanargmin)}."
    return Panel("smallest bend radius [mm]", curves, sentence, is_logarithmic=True, limit=limit)


def _contacts(steps: _Steps) -> Panel:
    curves = (steps.curve("contacts", "contacts"), steps.curve("rounds", "rounds"))
    sentence = (
        f"Places at which cables are pushed or held by a body, {curves[0].y.max():.0f} at most, and how often the boundary conditions of a "
        f"step were evaluated until nothing changed, {curves[1].y.max():.0f} times at most."
    )
    return Panel("number in a step [-]", curves, sentence)


def _misses(steps: _Steps) -> Panel:
    curves = (steps.curve("penetration", "penetration", 1e6), steps.curve("grasp error", "grasp error", 1e6))
    shown = tuple(Curve(curve.name, np.where(curve.y > 0.0, curve.y, UNKNOWN)) for curve in curves)
    sentence = (
        f"How deep a cable is in a body, {curves[0].y.max():.3g} um at most, and how far a held point is from its gripper, "
        f"{curves[1].y.max():.3g} um at most."
    )
    return Panel("depth, distance [um]", shown, sentence, is_logarithmic=True)


def _torques(steps: _Steps) -> Panel | None:
    curve = steps.curve("torque", "torque")
    if not curve.y.any():
        return None
    sentence = f"The largest static torque of a joint over its limit. {_extreme(steps, (curve,), 'of the limit', np.nanargmax)}."
    return Panel("joint torque over its limit [-]", (curve,), sentence, limit=("limit", 1.0))


def _extreme(steps: _Steps, curves: Sequence[Curve], unit: str, place: Callable[[np.ndarray], np.intp]) -> str:
    """The largest or smallest value of several curves, and when that was."""
    known = np.array([curve.y for curve in curves])
    if np.isnan(known).all():
        return "Not known"
    row, step = divmod(int(place(known)), known.shape[1])
    which = f" ({curves[row].name})" if len(curves) > 1 else ""
    kind = "Largest" if place is np.nanargmax else "Smallest"
    return f"{kind}: {known[row, step]:.3g} {unit} at {steps.time[step]:.4g} s{which}"


def cables_of(cables: Sequence[Cable]) -> str:
    """What the cables of a scene are, in a line."""
    return "; ".join(f"{cable.name}: {cable.length:.4g} m, {1e3 * cable.diameter:.3g} mm thick" for cable in cables)
