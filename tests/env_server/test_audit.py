"""Audits of the choice of effects: an honest prediction stands, a false one is found out, and a run is the same however it was heard."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from typing import Any, cast

import pytest
from in_process import Direct
from test_effects_in_the_loop import CABLE, scene

from env_server.audit import Auditor, Audits, auditor_of, due_after
from env_server.loop import Loop
from env_server.memory import checkpoint, resume
from env_server.stage import Stage
from env_server.stepped import Stepped
from protocol.errors import PeerLostError
from protocol.messages import ShapeReply
from protocol.scene import Cable, LumpedMass, Scene
from shape_server.effects import bending, stretch

STIFF = replace(CABLE, bending=1e-3, twist=1e-3)
MANY = replace(STIFF, stretch=3e4, masses=(LumpedMass(0.5, 2e-5),), micro_length=1e-3)


class Lost(Direct):
    """An auditor that never answers."""

    def receive(self) -> ShapeReply:
        raise PeerLostError("silent", key="audit")


def stiff(cable: Cable = MANY, *, every: int = 10) -> Scene:
    """The cable of the effects in the loop, with these numbers."""
    return replace(scene(), cables=(cable,), audit_every=every)


def run(of: Scene, asker: Direct | None = None, *, forget_after: int | None = None) -> list[Stepped]:
    """Every step of a scene with an auditor; after one of them by another loop that goes on from its checkpoint."""
    with closing(Stage(of, lambda _: None)) as stage:
        auditor = Auditor(of, cast(Any, asker or Direct()))
        loop = Loop(stage, cast(Any, Direct()), "test", auditor)
        out = [loop.first()]
        for step in range(1, stage.path.steps + 1):
            out.append(loop.advance(step))
            if step == forget_after:
                kept = checkpoint(loop, "test", step, 0.0, 0)
                loop = Loop(stage, cast(Any, Direct()), "test", Auditor(of, cast(Any, Direct())))
                resume(loop, kept)
        return out


def test_one_step_of_every_stretch_is_audited_and_counts_from_the_next_stretch_on_or_at_the_end() -> None:
    found = [(step, due) for step in range(101) if (due := due_after(step, 20, 90)) is not None]
    assert [step // 20 for step, _ in found] == [0, 1, 2, 3, 4]
    assert all(step % 20 < 10 for step, _ in found)
    assert [due for _, due in found] == [20, 40, 60, 80, 90]
    assert [due_after(step, 1, 3) for step in range(4)] == [1, 2, 3, None]
    assert {due_after(step, 0, 100) for step in range(100)} == {None}


@pytest.mark.parametrize("cable", [MANY, CABLE], ids=["rod without three effects", "catenary for a rod"])
def test_an_honest_prediction_stands_and_nothing_is_switched(cable: Cable) -> None:
    told = [one for stepped in run(stiff(cable)) for one in stepped.audits]
    assert len(told) >= 3
    assert all(one.actual is not None and not one.is_broken for one in told)
    assert all(0.0 < one.actual < 1.5e-3 for one in told if one.actual is not None)
    assert not any(one.is_switched_on for one in told)


@pytest.mark.parametrize(
    ("module", "cable", "name"),
    [
        (stretch, replace(STIFF, stretch=60.0), "stretch"),
        (bending, replace(CABLE, bending=1e-4, twist=1e-4, stretch=None), "bending"),
    ],
)
def test_a_false_prediction_is_found_out_and_the_effect_is_on_from_then_on(
    module: Any, cable: Cable, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = module.size
    monkeypatch.setattr(module, "size", lambda *known: honest(*known)._replace(length=1e-3 * honest(*known).length))
    steps = run(stiff(cable))
    first = next(index for index, stepped in enumerate(steps) if any(one.is_switched_on for one in stepped.audits))
    broken = next(one for one in steps[first].audits if one.is_switched_on)
    assert first % 10 == 0
    assert broken.name == name
    assert broken.is_broken
    assert broken.actual is not None
    assert broken.actual > 10 * broken.bound
    assert all(name not in stepped.cables[0].shape.effects for stepped in steps[:first])
    for stepped in steps[first:]:
        assert name in stepped.cables[0].shape.effects
        # Where nothing is left to choose there are no predictions any more.
        assert {one.why for one in stepped.cables[0].shape.predicted if one.name == name} <= {"audit"}


def test_what_is_forced_off_is_told_and_stays_off() -> None:
    of = replace(stiff(replace(STIFF, stretch=60.0)), effects={"stretch": False})
    steps = run(of)
    told = [one for stepped in steps for one in stepped.audits]
    assert told
    assert not any(one.is_switched_on for one in told)
    assert all("stretch" not in stepped.cables[0].shape.effects for stepped in steps)


def test_a_run_that_was_killed_between_question_and_answer_goes_on_to_the_same_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stretch, "MARGIN", 1e-3)
    of = stiff(replace(STIFF, stretch=60.0))
    for whole, again in zip(run(of), run(of, forget_after=8), strict=True):
        assert whole.audits == again.audits
        assert whole.cables[0].shape.nodes.tobytes() == again.cables[0].shape.nodes.tobytes()


def test_an_auditor_that_is_lost_is_told_and_the_run_goes_on_without() -> None:
    steps = run(stiff(), Lost())
    told = [one for stepped in steps for one in stepped.audits]
    assert {one.actual for one in told} == {None}
    assert {one.step // 10 for one in told} == {0}
    assert not any(one.is_broken for one in told)


def test_nothing_is_asked_where_nothing_is_left_out_or_no_audit_is_wanted() -> None:
    asker = Direct()
    run(stiff(replace(STIFF, stretch=60.0)), asker)
    assert asker.requests == []
    assert auditor_of(stiff(every=0), cast(Any, asker)) is None
    fixed = replace(stiff(), effects=("gravity", "bending", "twist", "stretch", "masses", "micro_length"))
    assert auditor_of(fixed, cast(Any, asker)) is None
    assert Audits().table(0, {}) == {}
