"""The picture of the choice of effects: what it shows is what the recording says."""

from __future__ import annotations

from pathlib import Path

import msgspec
from synthetic import SNAPSHOT, frame, shape, write_run

from protocol import recording
from protocol.codec import encode
from protocol.messages import Audited, Frame, Predicted
from viz_client.effects import sentence, tracks, write_effects
from viz_client.redraw import page


def chosen(number: int, size: float | None, *, is_on: bool = False, why: str = "below", audits: tuple[Audited, ...] = ()) -> Frame:
    """A frame whose cable has stretch on or off; with no size, on without a choice."""
    one = () if size is None else (Predicted(name="stretch", size=size, force=1.0, curvature=0.1, is_on=is_on, why=why),)
    effects = ("gravity", "stretch") if size is None or is_on else ("gravity",)
    shapes = (msgspec.structs.replace(shape(1.0), predicted=one, effects=effects),)
    return msgspec.structs.replace(frame(number), shapes=shapes, audits=audits)


def audit(step: int, predicted: float, actual: float) -> Audited:
    broken = actual > predicted
    return Audited(step=step, cable=0, name="stretch", bound=predicted, actual=actual, is_broken=broken, is_switched_on=broken)


FRAMES = [
    chosen(0, 5e-4, is_on=True, why="above"),
    chosen(1, 2e-5),
    chosen(2, 4e-5, audits=(audit(1, 2e-5, 1e-5),)),
    chosen(3, 4e-5),
    chosen(4, None, audits=(audit(2, 4e-5, 8e-5),)),
]


def test_a_track_has_state_and_bound_of_every_step_and_audits_at_the_steps_that_were_audited() -> None:
    (track,) = tracks(FRAMES, ["harness"])
    assert track.states == [(True, "above"), (False, "below"), (False, "below"), (False, "below"), (True, "audit")]
    assert [size for size in track.sizes if size == size] == [2e-2, 4e-2, 4e-2]
    assert [(round(time, 9), one.actual) for time, one in track.audits] == [(0.1, 1e-5), (0.2, 8e-5)]
    assert sentence([track], 1.0) == (
        "Left out, at a tolerance of 1 mm: stretch (at most 0.04 mm). "
        "2 audits: what was left out moved the cable by 200% of its bound at most; 1 of the bounds was broken."
    )


def test_the_picture_stands_beside_the_page_of_a_run_whose_effects_are_chosen_and_of_no_other(tmp_path: Path) -> None:
    with recording.Writer(tmp_path / recording.FILE_NAME) as writer:
        for message in (SNAPSHOT, *FRAMES):
            writer.write(encode(message))
    said: list[str] = []
    page(tmp_path, said.append)
    assert (tmp_path / "effects.svg").read_text(encoding="utf-8").startswith("<svg")
    assert any(line.startswith("effects.svg: Left out") for line in said)
    (tmp_path / "plain").mkdir()
    plain = recording.read(write_run(tmp_path / "plain"))
    assert write_effects(plain, tmp_path / "plain" / "effects.svg") == ""
    assert not (tmp_path / "plain" / "effects.svg").exists()
