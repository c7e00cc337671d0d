"""The viewer as a program: `python -m viz_client`."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Event
from typing import NoReturn

from protocol.errors import CablecosimError, PeerLostError
from protocol.keys import read

DESCRIPTION = """Record a run of the environment, draw pictures of its key postures, and write a page that replays it.

Needs no display. Writes into the folder DIR:
  recording.msgpack   every message as it came; readable with any MessagePack library, even after a crash
  pictures/*.png      the key postures
  report.html         what it came to: verdict, postures, curves; opens in a browser, offline
  replay.html         every step in three dimensions; opens in a browser, offline
  bill.svg            where the time of every step went
  effects.svg         which effects were simulated when, why, and what those left out could have changed
"""
EPILOG = """exit codes: 0 all of the run was recorded, or it was told to stop; 1 the environment was lost; 2 a wrong request

example: python -m viz_client --frames ipc:///tmp/me/frames --control ipc:///tmp/me/control --out runs/mine"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say one sentence, without the usage."""
        self.exit(2, f"{self.prog}: {message}; see --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the viewer; returns the exit code."""
    parser = _Parser(prog="viz_client", description=DESCRIPTION, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", metavar="ADDRESS", help="lossless stream of the environment: ipc://PATH or tcp://127.0.0.1:PORT")
    parser.add_argument("--control", metavar="ADDRESS", help="where the environment answers: ipc://PATH or tcp://127.0.0.1:PORT")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the run, made if need be; must not hold a recording")
    parser.add_argument("--redraw", metavar="DIR", type=Path, help="instead: make pictures and page of a recorded run anew")
    parser.add_argument("--accuracy", metavar="FILE", type=Path, help="instead: draw the page of a report of `cablecosim accuracy`")
    parser.add_argument("--paper", metavar="FILE", type=Path, help="instead: draw the page of a report of `cablecosim paper`")
    parser.add_argument("--resume", action="store_true", help="go on with the recording that DIR may hold, of this run")
    parser.add_argument(
        "--patience",
        metavar="SECONDS",
        type=float,
        default=0.0,
        help="wait so long for an environment that is gone to come back (default 0)",
    )
    parser.add_argument("--keys", metavar="DIR", type=Path, help="talk to an environment that is encrypted; see: cablecosim keys")
    parser.add_argument("--no-replay", dest="replay", action="store_false", help="write neither replay.html nor report.html")
    parser.add_argument("--no-pictures", dest="pictures", action="store_false", help="draw no pictures")
    given = parser.parse_args(arguments)
    live = [name for name in ("frames", "control", "out") if getattr(given, name) is not None]
    others = [name for name in ("redraw", "accuracy", "paper") if getattr(given, name) is not None]
    if not others and len(live) < 3:
        missing = [f"--{name}" for name in ("frames", "control", "out") if name not in live]
        parser.error(f"{', '.join(missing)} missing; give --frames, --control and --out, or --redraw alone")
    if len(others + live) > 1 and others:
        parser.error(f"--{others[0]} does not go with --{(others + live)[1]}")
    try:
        if given.accuracy is not None or given.paper is not None:
            return _draw_page(given)
        return _redraw(given) if given.redraw is not None else _watch(given)
    except (CablecosimError, OSError) as error:
        sys.stderr.write(f"viz_client: {error}\n")
        return 1 if isinstance(error, PeerLostError) else 2


def _watch(given: argparse.Namespace) -> int:
    from .client import watch

    stop = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    watched = watch(
        given.frames,
        given.control,
        given.out,
        replay=given.replay,
        pictures=given.pictures,
        resume=given.resume,
        patience=given.patience,
        keys=read(given.keys) if given.keys is not None else None,
        say=_say,
        stop=stop,
    )
    return 0 if watched.complete or stop.is_set() else 1


def _redraw(given: argparse.Namespace) -> int:
    from .redraw import redraw

    redraw(given.redraw, replay=given.replay, pictures=given.pictures, say=_say)
    return 0


def _draw_page(given: argparse.Namespace) -> int:
    """The page of a report, beside it."""
    from . import accuracy_page, paper_page

    report: Path = given.accuracy if given.accuracy is not None else given.paper
    page = report.with_suffix(".html")
    (accuracy_page if given.accuracy is not None else paper_page).write(report, page)
    _say(f"written to {page}")
    return 0


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
