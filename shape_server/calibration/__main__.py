"""Fit a cable's numbers to measured points: `cablecosim calibrate`, which hands the posture over on standard input."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from protocol.codec import decode
from protocol.errors import CablecosimError
from protocol.messages import ShapeRequest

from .. import blas
from ..paths import Paths, is_compiled
from .fit import Calibration, calibrate
from .measured import read_points
from .parameters import PARAMETERS
from .report import as_json, table


def main() -> int:
    """Fit what the command line asks for; 0 if every number has both bounds, 1 if not, 2 for a mistake."""
    blas.use_one_thread()
    arguments = _parser().parse_args()
    if arguments.json is not None and not arguments.json.absolute().parent.is_dir():
        sys.stderr.write(f"calibrate: {arguments.json}: there is no such folder; give a file in a folder that exists\n")
        return 2
    try:
        found = _calibrated(arguments.points, tuple(arguments.fit or ()))
    except CablecosimError as error:
        sys.stderr.write(f"calibrate: {error}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    sys.stdout.write(table(found) + "\n")
    if arguments.json is not None:
        arguments.json.write_text(as_json(found, arguments.points), encoding="utf-8")
    return int(not all(one.is_determined for one in found.intervals.values()))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shape_server.calibration", description="Fits numbers of a cable to measured points; see `cablecosim calibrate`."
    )
    parser.add_argument("points", type=Path, help="comma-separated values with columns x, y and z")
    parser.add_argument("--fit", nargs="*", choices=PARAMETERS, help="numbers to fit; those that the points determine unless given")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write intervals, deviations and the fitted shape")
    return parser


def _calibrated(points: Path, names: tuple[str, ...]) -> Calibration:
    measured = read_points(points)
    request = decode(sys.stdin.buffer.read())
    if not isinstance(request, ShapeRequest):
        raise CablecosimError(f"standard input holds a {type(request).__name__}; must be a ShapeRequest")
    paths = Paths("compiled" if is_compiled() else "numpy")
    return calibrate(request.problems[0], request.gravity, measured, names, path=paths.current, told=_say)


def _say(sentence: str) -> None:
    sys.stderr.write(f"calibrate: {sentence}\n")


if __name__ == "__main__":
    sys.exit(main())
