"""The bill of a run: what the picture shows is what the recording says."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from synthetic import BILL, SNAPSHOT, frame, write_run

from protocol import recording
from protocol.codec import encode
from protocol.messages import Frame
from viz_client.bill import sentence, write_bill
from viz_client.redraw import page


def billed(number: int, **parts: float) -> Frame:
    bill = msgspec.structs.replace(BILL, total=sum(parts.values()), **parts)
    return msgspec.structs.replace(frame(number), time=0.1 * number, bill=bill)


def test_the_sentence_names_the_median_the_largest_part_and_the_longest_step() -> None:
    frames = [billed(1, solve=2e-3, wire=1e-3), billed(2, solve=2e-3, wire=1e-3), billed(3, search=9e-3, solve=6e-3)]
    assert sentence(frames) == (
        "The median step took 3 ms. Most went to 'solve', 48% of the 0.021 s that all 3 steps took; "
        "the longest, at 0.3 s, took 0.015 s, most of it 'search'."
    )


@pytest.mark.thorough
def test_the_picture_stands_beside_the_page_and_shows_only_parts_that_took_time(tmp_path: Path) -> None:
    with recording.Writer(tmp_path / recording.FILE_NAME) as writer:
        writer.write(encode(SNAPSHOT))
        for number in range(5):
            writer.write(encode(billed(number, solve=2e-3, encode=1e-3)))
    said: list[str] = []
    page(tmp_path, said.append)
    text = (tmp_path / "bill.svg").read_text(encoding="utf-8")
    assert text.startswith("<svg")
    assert text.count("FillBetweenPolyCollection") == 2
    assert any("bill.svg: The median step took 3 ms" in line for line in said)


def test_a_run_without_steps_has_no_bill(tmp_path: Path) -> None:
    with recording.Writer(tmp_path / recording.FILE_NAME) as writer:
        writer.write(encode(SNAPSHOT))
    assert write_bill(recording.read(tmp_path / recording.FILE_NAME), tmp_path / "bill.svg") == ""
    assert not (tmp_path / "bill.svg").exists()


def test_a_run_whose_steps_took_no_time_has_no_bill_either(tmp_path: Path) -> None:
    assert write_bill(recording.read(write_run(tmp_path)), tmp_path / "bill.svg") == ""
