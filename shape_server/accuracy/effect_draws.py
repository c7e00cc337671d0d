"""Random requests that ask for several effects at once, each from far too small to matter to far too large to leave out."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.cable import Cable, LumpedMass
from protocol.kinds import Hold
from protocol.messages import Grasps, Problem

from .draws import GRAVITY, LEVEL, Draw

KINDS = ("in space", "level", "three held points", "hinges", "tail")


def draw_effects(seed: int) -> Draw:
    """The request of a seed: EI over weight times length cubed from 1e-11 to 1, tolerances from 1e-5 to 5e-3 of the length."""
    rng = np.random.default_rng([24, seed])
    length, weight = 10 ** rng.uniform(-0.5, 0.7), 10 ** rng.uniform(-1.0, 1.0)
    kind = KINDS[seed % len(KINDS)]
    cable = _cable(rng, length, weight)
    problem = Problem(cable=cable, grasps=_grasps(rng, kind, length), effects={})
    return Draw(kind, problem, GRAVITY, float(length * 10 ** rng.uniform(-5.0, -2.3)), lambda shape: None)


def _cable(rng: np.random.Generator, length: float, weight: float) -> Cable:
    bending = weight * length**3 * 10 ** rng.uniform(-11.0, 0.0)
    has = dict(zip(("stretch", "preform", "micro_length", "bend_radius", "masses", "flat"), rng.random(6) < 0.5, strict=True))
    at = rng.uniform(0.1, 0.9, 2)
    return Cable(
        name="drawn",
        length=length,
        diameter=1e-3 * length,
        mass_per_length=weight / 9.81,
        bending=bending,
        bending_2=float(rng.uniform(1.0, 3.0)) * bending if has["flat"] and rng.random() < 0.5 else None,
        twist=float(rng.uniform(0.4, 1.6)) * bending,
        stretch=weight * length * 10 ** rng.uniform(1.5, 7.0) if has["stretch"] else None,
        natural_curvature=tuple(rng.normal(size=3) * 10 ** rng.uniform(-4.0, 0.3) / length) if has["preform"] else None,
        micro_length=length * 10 ** rng.uniform(-4.5, -1.3) if has["micro_length"] else None,
        bend_radius=length * 10 ** rng.uniform(-4.0, -1.0) if has["bend_radius"] else None,
        masses=tuple(LumpedMass(float(place) * length, weight * length / 9.81 * 10 ** rng.uniform(-7.0, -0.5)) for place in np.sort(at))
        if has["masses"]
        else (),
    )


def _grasps(rng: np.random.Generator, kind: str, length: float) -> Grasps:
    distance = length * (1.0 - 10 ** rng.uniform(-2.0, -0.1))
    frames = Rotation.random(3, random_state=rng).as_quat() if kind != "level" else np.array([LEVEL.as_quat()] * 3)
    slope = rng.uniform(-0.8, 0.8)
    place = distance * np.array([np.cos(slope), 0.0, np.sin(slope)])
    s, points = np.array([0.0, length]), np.array([np.zeros(3), place])
    hold: tuple[Hold, ...] = (Hold.CLAMP, Hold.CLAMP)
    if kind == "hinges":
        hold = ((Hold.HINGE, Hold.HINGE), (Hold.HINGE, Hold.CLAMP))[int(rng.integers(2))]
    if kind == "tail":
        s = np.array([0.0, rng.uniform(0.6, 0.9) * length])
        points[1] *= s[1] / length
    if kind == "three held points":
        part = rng.uniform(0.3, 0.7)
        s, points = np.array([0.0, part * length, length]), np.array([np.zeros(3), part * place, place])
        hold = (Hold.CLAMP, Hold.HINGE, Hold.CLAMP)
    return Grasps(s=s, position=points, quaternion=frames[: len(s)], hold=hold)
