"""The report of a run: what it says is what the recording says, and the page needs nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import numpy as np
from synthetic import SNAPSHOT, frame, shape, write_run

from protocol import recording
from protocol.codec import encode
from protocol.kinds import Outcome
from protocol.messages import Finished, Frame
from viz_client.history import history
from viz_client.report_page import write_report


def write(folder: Path, frames: list[Frame], *, sentence: str = "finished", failed: bool = False) -> Path:
    with recording.Writer(folder / recording.FILE_NAME) as writer:
        for message in (SNAPSHOT, *frames, Finished(session="run", frames=len(frames), failed=failed, sentence=sentence)):
            writer.write(encode(message))
    return folder


def numbered(number: int, **changes: object) -> Frame:
    return msgspec.structs.replace(frame(number), **changes)  # type: ignore[arg-type]


def test_a_page_stands_alone_and_says_that_all_went_well(tmp_path: Path) -> None:
    write_run(tmp_path)
    page = write_report(tmp_path).read_text(encoding="utf-8")
    assert "A made-up &lt;run&gt;" in page
    assert "&#10003; " in page
    assert "every shape converged" in page
    links = re.findall(r'(?:href|src)="([^"#][^"]*)"', page)
    assert set(links) <= {"replay.html"}
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_what_went_wrong_comes_first(tmp_path: Path) -> None:
    lost = msgspec.structs.replace(shape(1.0), outcome=Outcome.UNREACHABLE)
    frames = [numbered(0), numbered(1, collisions=(("hand", "table"),)), numbered(2, shapes=(lost,))]
    page = write_report(write(tmp_path, frames, sentence="the cable is too short", failed=True)).read_text(encoding="utf-8")
    told = re.findall(r"&#10007; ([^<]*)<", page)
    assert told == ["the cable is too short", "1 of 3 shapes did not converge", "robot and bodies collide in 1 step"]
    assert "&#10003;" not in page


def test_curves_hold_the_numbers_of_the_steps_in_the_units_of_their_axes(tmp_path: Path) -> None:
    frames = [numbered(k, penetration=1e-6 * k, rounds=k + 1, torque_ratio=0.1 * k) for k in range(4)]
    found = history(recording.read(write(tmp_path, frames) / recording.FILE_NAME))
    panels = {panel.label: panel for panel in found.panels}
    assert np.allclose(found.time, [0.0, 0.1, 0.2, 0.3])
    errors = panels["error estimate [mm]"]
    assert np.allclose(errors.curves[0].y, 1e-2)  # the made-up shapes say 1e-5 m
    assert errors.limit == ("tolerance", 1e3 * SNAPSHOT.scene.tolerance)
    assert "in every step within" in errors.sentence
    assert np.allclose(panels["depth, distance [um]"].curves[0].y[1:], [1.0, 2.0, 3.0])
    assert "3 um at most" in panels["depth, distance [um]"].sentence
    assert panels["number in a step [-]"].curves[1].y.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert "0.3 of the limit at 0.3 s" in panels["joint torque over its limit [-]"].sentence
    assert "1.25 N" in panels["largest force [N]"].sentence


def test_frames_between_two_equilibria_are_no_steps(tmp_path: Path) -> None:
    frames = [numbered(0), numbered(1, relaxation=0.5), numbered(2)]
    folder = write(tmp_path, frames)
    assert len(history(recording.read(folder / recording.FILE_NAME)).time) == 2
    assert "1 frame in between" in write_report(folder).read_text(encoding="utf-8")


def test_what_one_more_round_would_change_counts_as_error(tmp_path: Path) -> None:
    found = history(recording.read(write(tmp_path, [numbered(0), numbered(1, coupling=(2e-3,))]) / recording.FILE_NAME))
    assert np.allclose(found.panels[0].curves[0].y, [0.01, 2.01])  # mm
    assert "above, or not known, in 1 of 2 shapes" in found.panels[0].sentence


def test_an_error_that_is_not_known_is_told(tmp_path: Path) -> None:
    unknown = msgspec.structs.replace(shape(1.0), error=None)
    found = history(recording.read(write(tmp_path, [numbered(0), numbered(1, shapes=(unknown,))]) / recording.FILE_NAME))
    assert "above, or not known, in 1 of 2 shapes" in found.panels[0].sentence


def test_a_run_without_a_step_has_a_page_too(tmp_path: Path) -> None:
    with recording.Writer(tmp_path / recording.FILE_NAME) as writer:
        writer.write(encode(SNAPSHOT))
    assert "breaks off before the end" in write_report(tmp_path).read_text(encoding="utf-8")
