"""Audits of the choice of effects: some steps are solved with every effect on as well, and what was left out is measured.

The steps of a run are cut into stretches of `audit_every`. One step of the first half of each, chosen by a seeded draw, is asked of a
shape server of its own, which is not waited for on the way; its answer counts from the first step of the next stretch on, whenever it came.
So a run gives the same frames however long an answer took, and however often a program was killed.

For each effect that was left out the cable is solved with all effects but this one (and what goes with it), and with all: the farthest that
a node moves, less what the meshes are uncertain by, is compared with what was predicted. An effect that moves it further is on from then
on. Not audited are steps in which cables touch each other: their shapes depend on each other, and so would every effect of one on all.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Final

import msgspec
import numpy as np

from protocol.effects import AUDIT, CHOOSABLE, WITH_BENDING, table_of
from protocol.errors import PeerLostError
from protocol.kinds import Model, Outcome
from protocol.messages import Audited, Problem, Shape, ShapeRequest
from protocol.scene import Scene

from .asking import Asker
from .stepped import Meter

SEED: Final = 0
FINER: Final = 0.1  # of the tolerance, asked of a shape that is found from the grasps alone
NOISE: Final = 1e-3  # of the tolerance; differences below are those of iterations that ended, not of effects


@dataclass(frozen=True)
class Claim:
    """What was said of one effect that a cable was solved without, and where the cable was."""

    cable: int
    name: str
    size: float  # m, predicted
    s: np.ndarray  # (n,) m
    nodes: np.ndarray  # (n, 3) m
    is_alone: bool  # nothing else was left out, so that the shape itself tells what this changed


@dataclass(frozen=True)
class Pending:
    """An audit that was asked for, and the step from which its answer counts."""

    step: int
    due: int
    request: ShapeRequest
    claims: tuple[Claim, ...]


@dataclass(frozen=True)
class Audits:
    """What a run remembers of its audits."""

    pending: Pending | None = None
    switched_on: tuple[tuple[int, str], ...] = ()  # cable and effect

    def table(self, cable: int, table: dict[str, bool]) -> dict[str, bool]:
        """The choice of effects of a cable, with what audits have switched on."""
        return table | {name: True for own, name in self.switched_on if own == cable}

    def marked(self, shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
        """Shapes that say why an effect is on that an audit has switched on."""
        if not self.switched_on:
            return shapes
        return tuple(
            msgspec.structs.replace(
                shape,
                predicted=tuple(
                    msgspec.structs.replace(one, why=AUDIT) if (cable, one.name) in self.switched_on else one for one in shape.predicted
                ),
            )
            for cable, shape in enumerate(shapes)
        )


class Auditor:
    """Asks for audits and hears their answers.

    Args:
        scene: What is run.
        asker: The way to the shape server that audits.
    """

    def __init__(self, scene: Scene, asker: Asker) -> None:
        self._scene, self._asker = scene, asker
        self._asked = -1  # step whose request is with the shape server
        self._is_lost = False
        self.is_wanted = False  # whether something has been left out

    def look(self, step: int, steps: int, kept: Audits, problems: Sequence[Problem], shapes: Sequence[Shape]) -> Audits:
        """Ask for the audit of a step that has ended, if it is one of those chosen; never waits."""
        left_out = any(shape.left_out for shape in shapes)
        self.is_wanted |= left_out
        due = due_after(step, self._scene.audit_every, steps)
        if due is None or not left_out or kept.pending is not None or self._is_lost:
            return kept
        claims = tuple(claim for cable, shape in enumerate(shapes) for claim in _claims(cable, shape))
        if not claims:
            return kept
        pending = Pending(step, due, self._request(step, problems, shapes, claims), claims)
        self._send(pending)
        return replace(kept, pending=pending)

    def hear(self, step: int, kept: Audits) -> tuple[Audits, tuple[Audited, ...]]:
        """What the audit came to whose answer counts from a step on, waited for if need be."""
        pending = kept.pending
        if pending is None or step < pending.due:
            return kept, ()
        if self._asked != pending.step:  # by a program that was killed
            self._send(pending)
        try:
            shapes = self._asker.receive().shapes
        except PeerLostError:
            self._is_lost = True
            return replace(kept, pending=None), tuple(_told(pending.step, claim, None, switches=False) for claim in pending.claims)
        found = tuple(self._audited(pending, shapes))
        on = tuple((one.cable, one.name) for one in found if one.is_switched_on)
        return Audits(None, kept.switched_on + on), found

    def close(self) -> None:
        """Hang up."""
        self._asker.close()

    def _send(self, pending: Pending) -> None:
        self._asked = pending.step
        self._asker.send(pending.request)

    def _request(self, step: int, problems: Sequence[Problem], shapes: Sequence[Shape], claims: tuple[Claim, ...]) -> ShapeRequest:
        """Of every cable with something left out its problem with everything on, and, for more than one effect, without each."""
        scene = self._scene
        asked = []
        for cable, own in groupby(claims, lambda claim: claim.cable):
            bare = problems[cable] if shapes[cable].model == Model.ROD.value else msgspec.structs.replace(problems[cable], start=None)
            asked.append(_with_all(bare))
            asked.extend(_without(bare, claim.name) for claim in own if not claim.is_alone)
        return ShapeRequest(
            session=scene.title[:40],
            step=step,
            round=0,
            gravity=scene.gravity,
            tolerance=FINER * scene.tolerance,
            problems=tuple(asked),
            extrapolate=False,
        )

    def _audited(self, pending: Pending, shapes: Sequence[Shape]) -> Iterator[Audited]:
        """Every claim beside what came of it."""
        rest = iter(shapes)
        forced = self._scene.effects if isinstance(self._scene.effects, dict) else {}
        is_list = not isinstance(self._scene.effects, str | dict)
        for _, own in groupby(pending.claims, lambda claim: claim.cable):
            whole = next(rest)
            for claim in own:
                other = None if claim.is_alone else next(rest)
                moved = _moved(claim, whole, other, NOISE * self._scene.tolerance)
                yield _told(pending.step, claim, moved, switches=not is_list and claim.name not in forced)


def auditor_of(scene: Scene, asker: Asker | None) -> Auditor | None:
    """What audits a scene by way of an asker; None where there is none, or where nothing may be left out."""
    table = table_of(scene.effects)
    names = [name for name in CHOOSABLE if name not in ("gravity", "twist") and table.get(name) is not True]
    may_leave_out = any(CHOOSABLE[name][1](cable) for name in names for cable in scene.cables)
    return Auditor(scene, asker) if asker is not None and scene.audit_every and may_leave_out else None


def is_wanted(auditor: Auditor | None) -> bool:
    """Whether an auditor has, or would have, something to do."""
    return auditor is not None and auditor.is_wanted


def heard(auditor: Auditor | None, step: int, kept: Audits, meter: Meter) -> tuple[Audits, tuple[Audited, ...]]:
    """What `Auditor.hear` says, with the time that it was waited for on the bill; nothing without one."""
    if auditor is None:
        return kept, ()
    begun = time.perf_counter()
    found = auditor.hear(step, kept)
    meter.wait += time.perf_counter() - begun
    return found


def due_after(step: int, every: int, steps: int) -> int | None:
    """The step from which the audit of a step counts, the run's last at the latest; None for a step that is not audited."""
    if not every or step >= steps:
        return None
    stretch = step // every
    place = int(np.random.default_rng([SEED, stretch]).integers((every + 1) // 2))
    return min((stretch + 1) * every, steps) if step == stretch * every + place else None


def _claims(cable: int, shape: Shape) -> list[Claim]:
    """What a shape says of the effects that it leaves out; those counted in bending say nothing of their own."""
    off = [one for one in shape.predicted if not one.is_on]
    if any(one.name == "bending" for one in off):
        off = [one for one in off if one.name not in WITH_BENDING]
    return [Claim(cable, one.name, one.size, shape.s, shape.nodes, len(off) == 1) for one in off]


def _with_all(problem: Problem) -> Problem:
    model = Model.ROD if problem.cable.bending is not None else Model.AUTO
    return msgspec.structs.replace(problem, effects=None, model=model)


def _without(problem: Problem, name: str) -> Problem:
    off = {name, *WITH_BENDING} if name == "bending" else {name}
    model = Model.ROD if problem.cable.bending is not None and name != "bending" else Model.AUTO
    return msgspec.structs.replace(problem, effects={each: each not in off for each in CHOOSABLE}, model=model)


def _moved(claim: Claim, whole: Shape, other: Shape | None, noise: float) -> tuple[float, float] | None:
    """What an effect surely moves a node by, and about by [m]; None without both shapes."""
    if whole.outcome is not Outcome.CONVERGED or (other is not None and other.outcome is not Outcome.CONVERGED):
        return None
    s, nodes = (claim.s, claim.nodes) if other is None else (other.s, other.nodes)
    if np.array_equal(s, whole.s):  # on the same mesh its errors cancel
        about = float(np.linalg.norm(nodes - whole.nodes, axis=1).max())
        return about - noise, about
    from scipy.interpolate import CubicSpline

    about = float(np.linalg.norm(CubicSpline(whole.s, whole.nodes)(s) - nodes, axis=1).max())
    known = (whole.error or 0.0) + (0.0 if other is None else max((other.error or 0.0) - sum(other.left_out.values()), 0.0))
    return about - known - noise, about


def _told(step: int, claim: Claim, moved: tuple[float, float] | None, *, switches: bool) -> Audited:
    is_broken = moved is not None and moved[0] > claim.size
    actual = None if moved is None else moved[1]
    return Audited(
        step=step,
        cable=claim.cable,
        name=claim.name,
        bound=claim.size,
        actual=actual,
        is_broken=is_broken,
        is_switched_on=is_broken and switches,
    )
