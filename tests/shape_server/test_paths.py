"""Numpy until the kernels are compiled."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rods import GRAVITY, cable, span

from protocol.channel import Client
from protocol.messages import AnyMessage, Beat, Message, Problem, ShapeReply, ShapeRequest
from shape_server import kernels, numpy_path
from shape_server.paths import CHOICES, Paths, compile_kernels, compiled_files, forget_stale_kernels, is_compiled

WAIT = 20.0  # s
ASK = ShapeRequest(session="s", step=0, round=0, gravity=GRAVITY, tolerance=1e-3, problems=(Problem(cable=cable(), grasps=span()),))


def reply_to(client: Client, message: Message) -> AnyMessage | None:
    """The reply, after any beats."""
    client.send(message)
    while isinstance(answer := client.receive(WAIT), Beat):
        pass
    return answer


def test_numpy_asked_for_stays_numpy() -> None:
    paths = Paths("numpy")
    paths.update()
    assert paths.current is numpy_path
    assert paths.state == "numpy"
    paths.close()


def test_compiled_asked_for_is_compiled_at_once() -> None:
    paths = Paths("compiled")
    assert paths.current is kernels
    assert paths.state == "compiled"
    paths.close()


def test_auto_takes_the_kernels_that_are_in_the_cache() -> None:
    compile_kernels()
    assert is_compiled()
    paths = Paths("auto")
    assert paths.state == "compiled"
    paths.close()


def test_compiled_code_is_made_from_the_files_that_count_towards_its_fingerprint_and_no_others() -> None:
    files = compiled_files()
    names = {file.stem for file in files}
    for file in files:
        imported = {node.module for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ImportFrom) and node.level == 1}
        assert imported <= names, f"{file.name} takes {imported - names} from files whose changes would not be noticed"


def test_a_compiler_that_was_ended_goes_on_from_there_and_code_of_other_sources_is_deleted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("shape_server.paths._cache", lambda: tmp_path / "cache")
    forget_stale_kernels()
    half_done = tmp_path / "cache" / "newton.newton_step-103.py311.nbi"
    half_done.write_bytes(b"")
    forget_stale_kernels()
    assert half_done.exists()
    assert not is_compiled()
    monkeypatch.setattr("shape_server.paths._fingerprint", lambda: "another")
    forget_stale_kernels()
    assert not half_done.exists()


def test_every_choice_has_a_state() -> None:
    assert CHOICES == ("auto", "compiled", "numpy")


def test_a_child_that_fails_leaves_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shape_server.paths.is_compiled", lambda: False)
    monkeypatch.setattr("shape_server.paths.sys.executable", "/bin/false")
    paths = Paths("auto")
    assert paths.state == "compiling"
    end = time.monotonic() + WAIT
    while paths.state == "compiling" and time.monotonic() < end:
        paths.update()
        time.sleep(0.01)
    assert paths.state == "numpy"
    assert paths.current is numpy_path
    paths.close()


def test_closing_ends_the_child(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shape_server.paths.is_compiled", lambda: False)
    paths = Paths("auto")
    child = paths._child
    assert child is not None
    paths.close()
    assert child.poll() is not None


@pytest.mark.slow
def test_a_server_with_an_empty_cache_answers_on_numpy_and_changes_over(tmp_path: Path) -> None:
    """As after a fresh installation; compiling takes about ten seconds of a core."""
    cache = tmp_path / "cache"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-m", "shape_server", "--bind", f"ipc://{tmp_path}/s"]
    begun = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as server:
        try:
            assert server.stdout is not None
            client = Client(server.stdout.readline().split()[-1], "test")
            assert client.greet(WAIT).kernels == "compiling"
            first = reply_to(client, ASK)
            assert isinstance(first, ShapeReply)
            assert first.shapes[0].cost.path == "numpy"
            assert time.monotonic() - begun < 10.0  # measured 2.1 s, most of it imports; compiling everything takes longer
            step, path = 1, "numpy"
            while path == "numpy" and time.monotonic() - begun < 120:
                time.sleep(0.5)
                later = reply_to(client, asked_in_step(step))
                assert isinstance(later, ShapeReply)
                path, step = later.shapes[0].cost.path, step + 1
            assert path == "numba"
            assert client.greet(WAIT).kernels == "compiled"
            client.close()
        finally:
            server.terminate()


def asked_in_step(step: int) -> ShapeRequest:
    """The same request in another step."""
    fields = {name: getattr(ASK, name) for name in ASK.__struct_fields__}
    return ShapeRequest(**(fields | {"step": step}))
