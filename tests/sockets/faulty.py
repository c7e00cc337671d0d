"""One of the three programs, that kills or stops itself at given points: `python faulty.py FOLDER PROGRAM ARGUMENTS...`.

FOLDER holds the points as lines of a file PROGRAM.points, `POINT MOMENT COUNT SIGNAL`: before, after or halfway through the COUNT-th
call of POINT in a process. Each comes true once, in the order of the lines, however often the program is started.
"""

from __future__ import annotations

import importlib
import os
import runpy
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

POINTS = {
    # A name: module, class or nothing, function.
    "ask": ("env_server.asking", "Asker", "send"),
    "hear": ("env_server.asking", "Asker", "receive"),
    "search": ("env_server.touch", "Touch", "search"),
    "robot": ("env_server.world", "World", "collisions"),
    "frame": ("env_server.journal", "Journal", "add"),
    "checkpoint": ("env_server.journal", "Journal", "keep"),
    "publish": ("protocol.channel", "Publisher", "publish"),
    "report": ("env_server.control", "Control", "report"),
    "receive": ("protocol.channel", "Server", "receive"),
    "answer": ("shape_server.server", "ShapeServer", "_answer"),
    "reply": ("protocol.channel", "Server", "send_bytes"),
    "take": ("protocol.channel", "Subscriber", "receive"),
    "record": ("protocol.recording", "Writer", "write"),
    "store": ("os", "", "pwrite"),
}


def fail(number: str) -> None:
    """What the launcher must notice."""
    os.kill(os.getpid(), getattr(signal, number))


def spoil(point: str, moment: str, count: int, number: str, done: Callable[[], None]) -> None:
    """Put a fault into a function."""
    module_name, kind, name = POINTS[point]
    owner = importlib.import_module(module_name)
    owner = getattr(owner, kind) if kind else owner
    real, calls = getattr(owner, name), 0

    def spoiled(*arguments: Any, **options: Any) -> Any:
        nonlocal calls
        calls += 1
        is_now = calls == count
        if is_now and moment == "halfway":  # of what is written
            done()
            real(arguments[0], arguments[1][: len(arguments[1]) // 2], *arguments[2:])
            fail(number)
        if is_now and moment == "before":
            done()
            fail(number)
        result = real(*arguments, **options)
        if is_now and moment == "after":
            done()
            fail(number)
        return result

    setattr(owner, name, spoiled)


if __name__ == "__main__":
    folder, program, *arguments = sys.argv[1:]
    file = Path(folder) / f"{program}.points"
    points = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    if points:
        point, moment, count, number = points[0].split()
        spoil(point, moment, int(count), number, lambda: file.write_text("\n".join(points[1:]), encoding="utf-8") and None)
    sys.argv = [program, *arguments]
    runpy.run_module(program, run_name="__main__", alter_sys=True)
