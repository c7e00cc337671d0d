"""The environment's own record: what was published is in it, and a run goes on from it bit for bit."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

import scenarios
from env_server.journal import CHECKPOINT, FRAMES, Journal
from env_server.loop import Loop
from env_server.memory import FORGOTTEN, REMEMBERED, Checkpoint, checkpoint, resume
from env_server.stage import Stage
from protocol import checkpoint as store
from protocol.codec import decode, encode
from protocol.errors import RecordingError
from protocol.messages import Bill, Finished, ShapeReply, ShapeRequest
from shape_server import kernels
from shape_server.solve import answer

sys.path.append(str(Path(__file__).parents[1] / "viz_client"))
import synthetic

SCENE = Path(__file__).parents[1] / "sockets" / "scenes" / "box.toml"
NOTHING = Bill(**dict.fromkeys(Bill.__struct_fields__, 0.0))


class Asker:
    """Answers in this process, over the wire's bytes."""

    coding = 0.0

    def send(self, request: ShapeRequest) -> None:
        self._request = decode(encode(request))

    def receive(self) -> ShapeReply:
        asked = self._request
        shapes = tuple(answer(problem, asked, kernels) for problem in asked.problems)
        reply = decode(encode(ShapeReply(session="", step=asked.step, round=asked.round, shapes=shapes, busy=0.0)))
        assert isinstance(reply, ShapeReply)
        return reply


def without_times(kept: Checkpoint) -> Checkpoint:
    """A checkpoint without what was measured."""
    cables = tuple(dataclasses.replace(cable, shape=msgspec.structs.replace(cable.shape, cost=synthetic.COST)) for cable in kept.now.cables)
    return dataclasses.replace(kept, now=dataclasses.replace(kept.now, cables=cables, bill=NOTHING))


def write(file: Path, kept: Checkpoint) -> None:
    """Store a checkpoint without its times."""
    writer = store.Writer(file)
    writer.write(without_times(kept))
    writer.close()


@pytest.mark.parametrize(
    ("scene", "steps", "every"),
    [(str(SCENE), 60, 6), pytest.param("harness_assembly", 300, 10, marks=pytest.mark.slow)],
    ids=["box", "harness"],
)
def test_a_loop_goes_on_from_a_checkpoint_to_the_last_bit(scene: str, steps: int, every: int, tmp_path: Path) -> None:
    loaded = scenarios.load(scene)
    first, second = Stage(loaded, str), Stage(loaded, str)
    loop = Loop(first, Asker(), "")  # type: ignore[arg-type]
    loop.first()
    files = [tmp_path / str(step) for step in range(steps + 1)]
    write(files[0], checkpoint(loop, "", 0, 0.0, 0))
    for step in range(1, steps + 1):
        loop.advance(step)
        write(files[step], checkpoint(loop, "", step, 0.0, 0))
    for begin in range(0, steps - 2, every):
        kept = store.read(files[begin], Checkpoint)
        assert kept is not None
        again = Loop(second, Asker(), "")  # type: ignore[arg-type]
        resume(again, kept)
        for step in range(begin + 1, begin + 4):
            again.advance(step)
            file = tmp_path / f"{step} again from {begin}"
            write(file, checkpoint(again, "", step, 0.0, 0))
            assert file.with_name(f"{file.name}.1").read_bytes() == files[step].with_name(f"{step}.1").read_bytes(), (
                f"from {begin}, step {step}"
            )
    for stage in (first, second):
        stage.close()


def test_a_loop_remembers_everything_that_it_does_not_begin_anew() -> None:
    """A new attribute of `Loop` belongs into one of the two lists of `memory`; forgotten, it would change a run that was resumed."""
    assert set(vars(Loop(None, None, ""))) == set(REMEMBERED) | FORGOTTEN  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "value",
    [np.array([1.5, -0.0, np.inf]), np.arange(6, dtype=np.int32).reshape(2, 3), np.array([True, False]), np.zeros((0, 3)), np.array(2.0)],
    ids=lambda value: f"{value.dtype} {value.shape}",
)
def test_arrays_keep_every_bit_in_a_checkpoint(value: np.ndarray, tmp_path: Path) -> None:
    writer = store.Writer(tmp_path / "file")
    writer.write(_Holder(value))
    writer.close()
    read = store.read(tmp_path / "file", _Holder)
    assert read is not None
    assert (read.value.dtype, read.value.shape, read.value.tobytes()) == (value.dtype, value.shape, value.tobytes())


class _Holder(msgspec.Struct):
    value: np.ndarray


def journal(folder: Path, frames: int, kept: int) -> Checkpoint:
    """The journal of a program that was killed after so many frames and checkpoints."""
    made, state = Journal(folder, "run"), None
    made.begin(encode(synthetic.SNAPSHOT))
    for number in range(frames):
        made.add(encode(synthetic.frame(number)))
        if number < kept:
            state = dataclasses.replace(_checkpoint(), step=number, size=made.size)
            made.keep(state)
    made.close()
    assert state is not None
    return state


def _checkpoint() -> Checkpoint:
    scene = Stage(scenarios.load(str(SCENE)), str)
    loop = Loop(scene, Asker(), "")  # type: ignore[arg-type]
    loop.first()
    made = checkpoint(loop, "run", 0, 0.0, 0)
    scene.close()
    return made


def test_frames_are_found_again_and_one_without_its_checkpoint_is_cut_off(tmp_path: Path) -> None:
    journal(tmp_path, 4, 3)
    again = Journal(tmp_path, "run")
    assert again.kept is not None
    assert again.kept.step == 2
    assert [again.message(number) for number in range(4)] == [*(encode(synthetic.frame(number)) for number in range(3)), None]
    again.begin(b"not written, for there is a beginning")
    again.add(encode(Finished(session="run", frames=3, failed=False, sentence="finished")))
    assert b"Finished" in (again.message(3) or b"")
    again.close()
    over = Journal(tmp_path, "run")
    assert over.ending == (False, "finished")
    over.close()


def test_a_journal_of_another_scene_or_another_program_is_refused(tmp_path: Path) -> None:
    journal(tmp_path, 1, 1)
    with pytest.raises(RecordingError, match="is of another scene; give an empty folder"):
        Journal(tmp_path, "another")
    writer = store.Writer(tmp_path / CHECKPOINT)
    writer.write(1)
    writer.close()
    with pytest.raises(RecordingError, match="is none of this program"):
        Journal(tmp_path, "run")


def test_a_journal_that_is_being_written_is_refused_and_left_alone(tmp_path: Path) -> None:
    journal(tmp_path, 3, 2)
    first = Journal(tmp_path, "run")
    first.add(encode(synthetic.frame(2)))
    size = (tmp_path / FRAMES).stat().st_size
    with pytest.raises(RecordingError, match="another program writes it"):
        Journal(tmp_path, "run")
    assert (tmp_path / FRAMES).stat().st_size == size
    first.close()


def test_the_checkpoint_before_is_there_whatever_part_of_the_last_was_written(tmp_path: Path) -> None:
    writer = store.Writer(tmp_path / "file")
    for number in range(3):
        writer.write([number] * 50)
    writer.close()
    whole = (tmp_path / "file.1").read_bytes()
    for size in range(0, len(whole), 7):
        (tmp_path / "file.1").write_bytes(whole[:size] + b"\xff" * (len(whole) - size))
        assert store.read(tmp_path / "file", list[int]) == [1] * 50
    again = store.Writer(tmp_path / "file")
    again.write([3])
    again.close()
    assert store.read(tmp_path / "file", list[int]) == [3]
