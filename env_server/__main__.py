"""Start the environment by hand: `python -m env_server --scene FILE.json --shape ADDRESS`."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from protocol import scene_file
from protocol.address import private_directory
from protocol.errors import CablecosimError, SceneError
from protocol.keys import read as read_keys
from protocol.scene import Scene

from .server import Run


def main() -> int:
    """Run one scene; 0 in good order, 1 if the run failed on its way, 2 with a sentence for a mistake."""
    arguments = _parser().parse_args()
    try:
        scene = _read_scene(Path(arguments.scene))
        options: dict[str, Any] = {name: getattr(arguments, name) for name in ("patience", "journal", "audit")}
        with _addresses(arguments) as addresses:
            keys = read_keys(arguments.keys) if arguments.keys is not None else None
            run = Run(scene, shape=arguments.shape, keys=keys, **options | addresses)
            signal.signal(signal.SIGTERM, lambda number, frame: _stop(run, number, frame))
            signal.signal(signal.SIGINT, lambda number, frame: _stop(run, number, frame))
            try:
                for purpose, address in run.addresses.items():
                    sys.stdout.write(f"{purpose:8s}{address}\n")
                sys.stdout.flush()
                sentence = run.go(at_once=arguments.start)
            finally:
                run.close()
    except CablecosimError as error:
        sys.stderr.write(f"env_server: {error}\n")
        return 2
    if sentence:
        sys.stdout.write(f"env_server: {sentence}\n")
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m env_server",
        description="Owns time and bodies: moves grippers, robot and bodies, finds where the cables touch, and publishes every step.",
        epilog="Addresses are ipc://PATH or tcp://127.0.0.1:PORT; without one, a private ipc path is made and printed.",
    )
    parser.add_argument(
        "--scene", metavar="FILE", required=True, help="resolved scene, as written by: cablecosim check SCENE --resolve FILE"
    )
    parser.add_argument("--shape", metavar="ADDRESS", required=True, help="where the shape server listens, now or soon")
    parser.add_argument("--frames", metavar="ADDRESS", help="publish every frame here, without loss, for recorders")
    parser.add_argument("--live", metavar="ADDRESS", help="publish frames here for looking; a slow viewer sees only the newest")
    parser.add_argument("--control", metavar="ADDRESS", help="answer start, pause, stop, snapshot and statistics here")
    parser.add_argument(
        "--patience", metavar="SECONDS", type=float, default=60.0, help="wait this long for a silent shape server (default 60)"
    )
    parser.add_argument(
        "--journal", metavar="DIR", type=Path, help="keep the run here too; started again with the same folder, it goes on from there"
    )
    parser.add_argument(
        "--keys", metavar="DIR", type=Path, help="encrypt, and let in only those known in this folder; see: cablecosim keys"
    )
    parser.add_argument(
        "--audit", metavar="ADDRESS", help="of a second shape server, which solves sampled steps with every effect; none without it"
    )
    parser.add_argument("--start", action="store_true", help="step as soon as the scene is ready, without waiting to be started")
    return parser


@contextmanager
def _addresses(arguments: argparse.Namespace) -> Iterator[dict[str, str]]:
    """Where to listen: as asked for, else in a private folder that is gone afterwards."""
    asked = {name: getattr(arguments, name) for name in ("frames", "live", "control")}
    if None not in asked.values():
        yield asked
        return
    box = private_directory()
    try:
        yield {name: address or f"ipc://{box}/{name}" for name, address in asked.items()}
    finally:
        shutil.rmtree(box, ignore_errors=True)


def _read_scene(path: Path) -> Scene:
    try:
        return scene_file.read(path.read_bytes())
    except OSError as error:
        raise SceneError(f"--scene: '{path}' cannot be read ({error.strerror}); give a resolved scene file", key="--scene") from error


def _stop(run: Run, number: int, frame: FrameType | None) -> None:
    run.stop()


if __name__ == "__main__":
    sys.exit(main())
