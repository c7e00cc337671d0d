"""The three programs as a user starts them by hand; every wait is bounded, and each is ended by its own id."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack

import scenarios
from protocol import recording, scene_file
from protocol.channel import Client
from protocol.messages import AnyMessage, Done, Pause, Resume, StartRun, Statistics, StatisticsRequest, Stop

ROOT = Path(__file__).resolve().parents[2]
SCENE = Path(__file__).parent / "scenes" / "box.toml"
STEPS = 60  # of SCENE
LIMIT = 90.0  # s for anything; a busy machine may be ten times slower than an idle one

MEASURED = {"bill", "cost", "busy", "versions"}
"""Fields that hold measured times, or the names of what measured them; nothing else may differ between two runs."""


class Program:
    """One program, started as `python -m NAME ...`; what it prints goes to a file."""

    def __init__(self, box: Path, name: str, *arguments: str) -> None:
        self.name = name
        self._log = box / f"{name}-{time.monotonic_ns()}.log"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", name, *arguments], cwd=ROOT, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    @property
    def words(self) -> str:
        """What it has printed so far."""
        return self._log.read_text(encoding="utf-8")

    def wait(self, limit: float = LIMIT) -> int:
        """Its exit code."""
        try:
            return self.process.wait(limit)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} has not ended within {limit:g} s; it said:\n{self.words}") from None

    def say(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self.process.send_signal(number)

    def end(self) -> None:
        """End it at once, if it still runs."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(LIMIT)


@dataclass
class Box:
    """A folder with short paths for the sockets of one test, and the programs started in it."""

    path: Path
    programs: list[Program]

    def at(self, name: str) -> str:
        """Address of that name."""
        return f"ipc://{self.path}/{name}"

    def start(self, name: str, *arguments: str) -> Program:
        """Start a program that is ended with the test."""
        program = Program(self.path, name, *arguments)
        self.programs.append(program)
        return program

    def shape_server(self, address: str | None = None) -> Program:
        """Start a shape server."""
        return self.start("shape_server", "--bind", address or self.at("shape"), "--kernels", "compiled")

    def env_server(self, shape: str | None = None, *options: str, scene: Path = SCENE, settings: Sequence[str] = ()) -> Program:
        """Start an environment with a scene, that of these tests unless given, on addresses in this folder."""
        addresses = [word for name in ("frames", "live", "control") for word in (f"--{name}", self.at(name))]
        scene = resolved(self.path, scene, settings)
        return self.start("env_server", "--scene", str(scene), "--shape", shape or self.at("shape"), *addresses, *options)

    def viz_client(self, out: Path, *options: str) -> Program:
        """Start a recorder that draws nothing."""
        where = ("--frames", self.at("frames"), "--control", self.at("control"), "--out", str(out))
        return self.start("viz_client", *where, "--no-replay", "--no-pictures", *options)


@contextmanager
def box() -> Iterator[Box]:
    """A folder for one test; an ipc path may have at most 100 bytes, which the folders of pytest can exceed."""
    with tempfile.TemporaryDirectory(prefix="cc-") as folder:
        made = Box(Path(folder), [])
        try:
            yield made
        finally:
            for program in reversed(made.programs):
                program.end()


def resolved(folder: Path, scene: Path = SCENE, settings: Sequence[str] = ()) -> Path:
    """A scene as the environment reads it."""
    file = folder / "scene.json"
    file.write_bytes(scene_file.write(scenarios.load(str(scene), settings)))
    return file


class Remote:
    """Control of an environment, from the test."""

    def __init__(self, address: str) -> None:
        self.client = Client(address, "test")
        self.client.greet(LIMIT)

    def tell(self, message: AnyMessage) -> AnyMessage:
        """The answer to a message."""
        return self.client.ask(message, LIMIT)

    def state(self) -> Statistics:
        """How far the run is."""
        answer = self.tell(StatisticsRequest())
        assert isinstance(answer, Statistics)
        return answer

    def wait_for(self, *states: str) -> Statistics:
        """Wait until the run is in one of these states."""
        return until(lambda: state if (state := self.state()).state in states else None)

    def start_held(self, recorders: int) -> None:
        """Start the run, and hold it before its first step; it is over so soon that a pause might come too late."""
        self.wait_for("ready")
        for message in (Pause(), StartRun(recorders=recorders)):
            assert self.tell(message) == Done()
        self.wait_for("paused")

    def hold_after(self, step: int) -> int:
        """Let a run that is held go on by a few steps at a time, until so many are done; how many they are."""
        while (state := self.wait_for("paused", "finished", "failed")).step < step:
            self.tell(Resume())
            time.sleep(0.01)
            self.tell(Pause())
        assert state.state == "paused", "the run was over before it could be held"
        return state.step

    def close(self) -> None:
        """Hang up."""
        self.client.close()


@contextmanager
def remote(box: Box) -> Iterator[Remote]:
    """Control of the environment in a folder; stops it at the end, if it is still there."""
    made = Remote(box.at("control"))
    try:
        yield made
        made.client.send(Stop())
        time.sleep(0.1)
    finally:
        made.close()


def until(look: Callable[[], Any], limit: float = LIMIT) -> Any:
    """Look again and again until there is something."""
    end = time.monotonic() + limit
    while (found := look()) is None:
        assert time.monotonic() < end, f"nothing came of it within {limit:g} s"
        time.sleep(0.01)
    return found


def plain(path: Path) -> list[dict[str, Any]]:
    """Messages of a recording as any MessagePack library reads them."""
    with path.open("rb") as file:
        return list(msgpack.Unpacker(file, max_buffer_size=0))


def recorded(folder: Path) -> list[dict[str, Any]]:
    """Messages of the recording in a folder, without what was measured."""
    return [without_measured(message) for message in plain(folder / recording.FILE_NAME)]


def without_measured(value: Any) -> Any:
    """A message without the fields that hold measured times."""
    if isinstance(value, dict):
        return {key: without_measured(item) for key, item in value.items() if key not in MEASURED}
    return [without_measured(item) for item in value] if isinstance(value, list) else value
