"""Start the shape server by hand: `python -m shape_server --bind ADDRESS`."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Final

from protocol.codec import decode, encode
from protocol.errors import CablecosimError
from protocol.keys import read as read_keys
from protocol.messages import ShapeReply, ShapeRequest

from . import blas
from .paths import CHOICES, Paths, compile_kernels
from .server import ShapeServer
from .solve import answer

GIVING_WAY: Final = 5  # niceness: a third of what others get of a busy processor, for an answer is waited for in the end


def main() -> int:
    """Run the server until it is stopped; 0 in good order, 2 with a sentence for a mistake."""
    arguments = _parser().parse_args()
    blas.use_one_thread()
    if arguments.gives_way:
        os.nice(GIVING_WAY)
    if not (arguments.warm_up or arguments.compile):  # the compiler would hold back a handler for seconds
        signal.signal(signal.SIGTERM, _leave)
    try:
        if arguments.compile:
            compile_kernels()
        elif arguments.warm_up:
            from .compiling import warm_up

            sys.stdout.write(f"kernels ready after {warm_up():.1f} s\n")
        elif arguments.posture:
            _solve_posture(arguments.kernels)
        else:
            keys = read_keys(arguments.keys) if arguments.keys is not None else None
            server = ShapeServer(arguments.bind, arguments.kernels, keys)
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, lambda *_: server.stop())
            sys.stdout.write(f"shape server listening at {server.address}\n")
            sys.stdout.flush()
            server.run()
    except CablecosimError as error:
        sys.stderr.write(f"shape_server: {error}\n")
        return 2
    except (KeyboardInterrupt, SystemExit):
        return 0
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shape_server",
        description="Predicts the shape of cables: boundary conditions in, shapes out. Keeps no state between requests.",
    )
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--bind", metavar="ADDRESS", help="listen here: ipc://PATH, or tcp://127.0.0.1:PORT (port 0 takes a free one)")
    task.add_argument("--posture", choices=["-"], help="answer one encoded ShapeRequest from standard input on standard output")
    task.add_argument("--warm-up", action="store_true", help="compile the kernels to the cache on disk, in two processes, and end")
    task.add_argument("--compile", action="store_true", help="the same in one process, beside other work")
    parser.add_argument(
        "--kernels",
        choices=CHOICES,
        default="auto",
        help="auto: numpy until the kernels are compiled (default); compiled: wait for them; numpy: never compile",
    )
    parser.add_argument("--gives-way", action="store_true", help="let other programs go first, for audits")
    parser.add_argument(
        "--keys", metavar="DIR", type=Path, help="encrypt, and let in only those known in this folder; see: cablecosim keys"
    )
    return parser


def _solve_posture(kernels: str) -> None:
    request = decode(sys.stdin.buffer.read())
    if not isinstance(request, ShapeRequest):
        raise CablecosimError(f"standard input holds a {type(request).__name__}; must be a ShapeRequest")
    paths = Paths("numpy" if kernels == "auto" else kernels)
    shapes = tuple(answer(problem, request, paths.current) for problem in request.problems)
    busy = sum(shape.cost.solve + shape.cost.estimate for shape in shapes)
    reply = ShapeReply(session=request.session, step=request.step, round=request.round, shapes=shapes, busy=busy)
    sys.stdout.buffer.write(encode(reply))
    sys.stdout.flush()


def _leave(signal_number: int, frame: FrameType | None) -> None:
    raise SystemExit


if __name__ == "__main__":
    sys.exit(main())
