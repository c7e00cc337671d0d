"""Scenes, recordings and messages are data: no code is run from one, and no path in one is written to."""

from __future__ import annotations

import ast
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from programs import ROOT

from env_server.meshes import load_body
from protocol import checkpoint, recording
from protocol.codec import decode, encode
from protocol.errors import CablecosimError, RecordingError
from protocol.messages import Finished
from protocol.scene import Body
from viz_client.redraw import redraw

sys.path.append(str(ROOT / "tests" / "viz_client"))
import synthetic

DRAWN = msgspec.structs.replace(synthetic.BILL, solve=1e-3, total=1e-3)
FORBIDDEN = {"pickle", "cPickle", "shelve", "marshal", "dill", "joblib", "yaml", "code", "codeop"}
CALLS = {"eval", "exec", "compile", "os.system", "os.popen", "zmq.Socket.recv_pyobj"}


class Bomb:
    """Writes a file when it is unpickled."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return (Path.touch, (self.target,))


def test_no_source_can_run_what_it_reads() -> None:
    """The painter's pipe to its own child is the one place where Python objects travel; nobody else holds an end of it."""
    for path in [
        path for room in ("protocol", "shape_server", "env_server", "viz_client", "scenarios") for path in (ROOT / room).rglob("*.py")
    ]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert not {alias.name.split(".")[0] for alias in node.names} & FORBIDDEN, path
            elif isinstance(node, ast.ImportFrom):
                assert (node.module or "").split(".")[0] not in FORBIDDEN, path
            elif isinstance(node, ast.Call):
                assert ast.unparse(node.func) not in CALLS, path
                assert not any(word.arg in ("shell", "allow_pickle") for word in node.keywords), path


@pytest.mark.parametrize(
    "suffix", ["pkl", "npy", "npz", "json", "dict", "dict64", "msgpack", "zip", "tar.gz", "obj", "stl", "glb", "py", ""]
)
def test_a_mesh_that_is_a_pickle_is_refused_and_not_run(suffix: str, tmp_path: Path) -> None:
    target, mesh = tmp_path / "run", tmp_path / f"mesh.{suffix}"
    mesh.write_bytes(pickle.dumps(Bomb(target)))
    with pytest.raises(CablecosimError):
        load_body(Body(name="bomb", mesh=str(mesh)), "bodies[0]")
    assert sorted(path.name for path in tmp_path.iterdir()) == [mesh.name]


def test_a_pickle_is_no_message_no_recording_and_no_checkpoint(tmp_path: Path) -> None:
    target, file = tmp_path / "run", tmp_path / "file"
    data = pickle.dumps(Bomb(target))
    file.write_bytes(data)
    for read in (lambda: decode(data), lambda: recording.read(file)):
        with pytest.raises(CablecosimError):
            read()
    file.rename(tmp_path / "file.0")
    assert checkpoint.read(file, Finished) is None
    assert not target.exists()


def test_an_array_of_objects_is_no_checkpoint(tmp_path: Path) -> None:
    class Holder(msgspec.Struct):
        value: synthetic.np.ndarray

    file = tmp_path / "file"
    writer = checkpoint.Writer(file)
    writer.write({"value": {"dtype": "O", "shape": [1], "data": bytes(8)}})
    writer.close()
    with pytest.raises(RecordingError, match="has no place in a checkpoint"):
        checkpoint.read(file, Holder)


@pytest.mark.slow  # it draws
def test_names_in_a_recording_lead_nowhere_out_of_its_folder(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "mine"
    run.mkdir(parents=True)
    script = "</title><script>alert(1)</script>"
    evil = ("../../../out", "/tmp/out", "a/../../b", "..", "\x00", script)
    scene = replace(synthetic.SCENE, title=script)
    solids = tuple(msgspec.structs.replace(solid, name=f"../{solid.name}") for solid in synthetic.SNAPSHOT.solids)
    with recording.Writer(run / recording.FILE_NAME) as writer:
        writer.write(encode(msgspec.structs.replace(synthetic.SNAPSHOT, scene=scene, solids=solids)))
        frames = [synthetic.frame(number) for number in range(len(evil))]
        for frame, name in zip(frames, evil, strict=True):
            writer.write(encode(msgspec.structs.replace(frame, picture=name, bill=DRAWN)))
    redraw(run)
    assert sorted(path.name for path in run.iterdir()) == ["bill.svg", "pictures", recording.FILE_NAME, "replay.html", "report.html"]
    assert [path.name[:3] for path in sorted((run / "pictures").iterdir())] == [f"{number:02d}_" for number in range(1, 1 + len(evil))]
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file() and run not in path.parents) == []
    for name in ("replay.html", "report.html"):
        assert script not in (run / name).read_text(encoding="utf-8")
