"""Stands in for the three programs in tests of the launcher: `python stand_ins.py BEHAVIOUR PROGRAM ARGUMENTS...`."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import recordings

from protocol import VERSION, recording, scene_file
from protocol.channel import Publisher, Server, Subscriber
from protocol.codec import decode, encode
from protocol.messages import Done, Finished, StartRun, Statistics, StatisticsRequest, Stop, Welcome

STEPS = 20


def shape_server(options: dict[str, str], behaviour: str) -> None:
    if behaviour == "die":
        sys.exit("no kernels")
    server = Server(options["--bind"], lambda: Welcome(version=VERSION, role="shape"))
    while not isinstance((server.receive(0.1) or (b"", None))[1], Stop):
        pass


class Environment:
    """Answers control messages in between the steps of a run without any physics."""

    def __init__(self, options: dict[str, str], behaviour: str) -> None:
        scene_file.read(Path(options["--scene"]).read_bytes())
        self.control = Server(options["--control"], lambda: Welcome(version=VERSION, role="env"))
        self.frames = Publisher(options["--frames"], lossless=True)
        self.live = Publisher(options["--live"], lossless=False)
        self.behaviour, self.state, self.step, self.stopped = behaviour, "starting", 0, False

    def answer(self, timeout: float) -> bool:
        """Answer what has come; whether it was a start."""
        peer, message = self.control.receive(timeout) or (b"", None)
        if isinstance(message, StatisticsRequest):
            sentence = "the left arm cannot reach its grasp" if self.state == "failed" else f"{self.state}, once"
            self.control.send(peer, Statistics(step=self.step, steps=STEPS, state=self.state, sentence=sentence))
        elif message is not None:
            self.control.send(peer, Done())
        self.stopped |= isinstance(message, Stop)
        return isinstance(message, StartRun)

    def run(self) -> None:
        end = time.monotonic() + 0.3
        while time.monotonic() < end or self.behaviour == "wait":
            self.answer(0.05)
        if self.behaviour == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        if self.behaviour == "refuse":
            sys.exit("env_server: bodies[0].mesh: no triangle in it; give a mesh of triangles")
        self.state = "failed" if self.behaviour == "fail" else "ready"
        while not self.answer(0.05):
            if self.stopped:
                return
        self.frames.wait_for(1, 20.0)
        self.state = "running"
        self.play()
        while not self.stopped and self.behaviour != "leave":
            self.answer(0.05)

    def play(self) -> None:
        self.frames.publish(encode(recordings.snapshot(STEPS)))
        for self.step in range(STEPS + 1):
            data = encode(recordings.frame(self.step, contacts=self.step))
            self.frames.publish(data)
            self.live.publish(data)
            self.answer(0.2 if self.behaviour == "slow" else 0.005)
            if self.behaviour == "die" and self.step == 5:
                sys.exit("the arm fell off")
            if self.stopped:
                break
        self.state = "finished"
        sentence = "stopped" if self.stopped else "every move is done"
        self.frames.publish(encode(Finished(session="test", frames=self.step + 1, failed=self.stopped, sentence=sentence)))


def env_server(options: dict[str, str], behaviour: str) -> None:
    environment = Environment(options, behaviour)
    environment.run()
    for part in (environment.frames, environment.live, environment.control):
        part.close()


def viz_client(options: dict[str, str], behaviour: str) -> None:
    stream = Subscriber(options["--frames"])
    if behaviour == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    with recording.Writer(Path(options["--out"]) / recording.FILE_NAME) as writer:
        while True:
            data = stream.receive(10.0)
            if data is None:
                sys.exit("nothing came")
            writer.write(data)
            if isinstance(decode(data), Finished):
                return


if __name__ == "__main__":
    behaviour, program, *words = sys.argv[1:]
    programs = {"shape_server": shape_server, "env_server": env_server, "viz_client": viz_client}
    try:
        programs[program](dict(zip(words[::2], words[1::2], strict=False)), behaviour)
    except SystemExit as error:
        print(error.code, file=sys.stderr)  # noqa: T201
        sys.exit(2 if behaviour == "refuse" else 7)
