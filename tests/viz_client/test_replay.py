from __future__ import annotations

import base64
import re
import socket

import msgspec
import numpy as np
import pytest
import zstandard
from synthetic import SNAPSHOT, frame, write_run

from protocol import recording
from protocol.codec import encode
from protocol.errors import RecordingError
from viz_client.replay import NODES, SIDES, write_replay


def embedded(page: str) -> dict:
    """What viser's client plays: its messages with their times."""
    packed = base64.b64decode(re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)[1])
    inner = zstandard.ZstdDecompressor().decompress(packed[8:], max_output_size=int.from_bytes(packed[:8], "little"))
    return msgspec.msgpack.decode(inner[8 : 8 + int.from_bytes(inner[:8], "little")])


def updates(run: dict, name: str, key: str) -> list[float]:
    """Times at which a property of a node is replaced."""
    return [
        time
        for time, message in run["messages"]
        if message.get("name") == name and key in (message.get("updates") or {}) and "props" not in message
    ]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert write_replay(write_run(folder), folder / "replay.html") == 11
    return (folder / "replay.html").read_text(encoding="utf-8")


def test_the_page_loads_nothing_from_elsewhere(page):
    shell = re.sub(r'__VISER_EMBED_DATA__="[^"]+"', "", page)
    assert not re.findall(r"<(?:script|img|link|iframe|source|video)[^>]*(?:src|href)\s*=\s*[\"']?(?:https?:)?//", shell)
    assert not re.findall(r"url\(\s*[\"']?https?:|@import\s+[\"']https?:", shell)


def test_the_page_holds_every_frame_at_its_time(page):
    run = embedded(page)
    assert run["durationSeconds"] == pytest.approx(2.0)  # 1 s of run, and 1 s to look at its end
    times = updates(run, "/cables/0", "vertices")
    assert times == pytest.approx([0.1 * i for i in range(1, 11)])


def test_what_stands_still_is_sent_once(page):
    run = embedded(page)
    names = [message.get("name", "") for _, message in run["messages"] if message["type"] == "SetPositionMessage"]
    assert names.count("/solids/1_hand") == 11
    assert names.count("/solids/0_table") == 1
    meshes = [message["name"] for _, message in run["messages"] if message["type"] == "MeshMessage"]
    assert sorted(meshes) == ["/cables/0", "/solids/0_table", "/solids/1_hand"]


def test_the_page_names_the_scene_and_its_key_postures(page):
    assert "<title>A made-up &lt;run&gt;</title>" in page
    assert "laid / down" in page
    labels = [m["updates"]["text"] for _, m in embedded(page)["messages"] if m.get("name") == "/label" and "updates" in m]
    assert labels[0].startswith("begin   |   t = 0.10 s")
    assert labels[-1].startswith("laid / down   |   t = 1.00 s    1 contact    largest tension 1.25 N")


def test_a_long_run_is_thinned_but_keeps_key_postures_and_its_end(tmp_path):
    path = tmp_path / "r"
    with recording.Writer(path) as writer:
        for message in (SNAPSHOT, *(frame(i, picture="key" if i == 17 else "") for i in range(60))):
            writer.write(encode(message))
    done = []
    count = write_replay(path, tmp_path / "p.html", frames_max=10, progress=lambda at, total: done.append((at, total)))
    assert count in (10, 11)
    assert done[-1] == (count, count)
    times = updates(embedded((tmp_path / "p.html").read_text()), "/cables/0", "vertices")
    assert {1.7, 5.9} <= {round(time, 6) for time in times}


def test_an_unfinished_recording_is_replayed_and_says_so(tmp_path):
    path = write_run(tmp_path, finished=False)
    assert write_replay(path, tmp_path / "p.html") == 11
    assert "after 11 frames, the run was not finished" in (tmp_path / "p.html").read_text()


def test_a_recording_without_frames_gives_no_page(tmp_path):
    with recording.Writer(tmp_path / "r") as writer:
        writer.write(encode(SNAPSHOT))
    assert write_replay(tmp_path / "r", tmp_path / "p.html") == 0
    assert not (tmp_path / "p.html").exists()


def test_a_file_that_is_no_recording_is_refused(tmp_path):
    (tmp_path / "r").write_bytes(b"nothing")
    with pytest.raises(RecordingError):
        write_replay(tmp_path / "r", tmp_path / "p.html")


def test_writing_says_nothing_and_leaves_no_port_open(tmp_path, capfd):
    opened = []

    class Watched(socket.socket):
        def bind(self, address):
            opened.append(address)
            super().bind(address)

    real, socket.socket = socket.socket, Watched
    try:
        write_replay(write_run(tmp_path), tmp_path / "p.html")
    finally:
        socket.socket = real
    assert capfd.readouterr() == ("", "")
    assert opened
    assert {host for host, *_ in opened} == {"127.0.0.1"}


def test_the_drawn_cable_has_the_radius_of_the_real_one():
    from synthetic import CABLE

    from viz_client.tube import resampled, tube

    nodes = resampled(frame(0).shapes[0].nodes, NODES)
    rings = tube(nodes, 0.5 * CABLE.diameter, sides=SIDES).vertices[:-2].reshape(NODES, SIDES, 3)
    assert np.linalg.norm(rings - nodes[:, None, :], axis=2) == pytest.approx(0.01)
