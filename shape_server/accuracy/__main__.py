"""Study or audit the price of accuracy: `python -m shape_server.accuracy study|audit|effects`, used by `cablecosim accuracy` and others."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path

from protocol.errors import CablecosimError

from .. import blas
from ..paths import is_compiled
from . import moving
from .audit import audit, summaries
from .problems import standard
from .report import audit_json, audit_table, from_elsewhere, study_json, study_table
from .study import study

WIDTH = 78


def main() -> int:
    """Run what the command line asks for; 0 if the price tags are true, 1 if not, 2 for a mistake."""
    blas.use_one_thread()
    arguments = _parser().parse_args()
    if arguments.json is not None and not arguments.json.absolute().parent.is_dir():
        sys.stderr.write(f"accuracy: {arguments.json}: there is no such folder; give a file in a folder that exists\n")
        return 2
    if not is_compiled():
        _say("compiling the kernels first, for a minute or two")
    try:
        return {"audit": _audit, "study": _study, "effects": _effects}[arguments.task](arguments)
    except CablecosimError as error:
        sys.stderr.write(f"accuracy: {error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("\naccuracy: interrupted\n")
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m shape_server.accuracy", description=__doc__)
    parser.add_argument("task", choices=["study", "audit", "effects"], help="errors against time, estimates against errors, or effects")
    parser.add_argument("--problem", action="append", metavar="NAME", help="study: one of the standard set; all unless given")
    parser.add_argument("--measured", type=Path, metavar="FILE", help="study: rows that were measured elsewhere, to be reported too")
    parser.add_argument("--nothing-else", action="store_true", help="study: nothing but what is named or measured elsewhere")
    parser.add_argument("--cases", type=int, default=1000, help="audit: how many random requests (default 1000)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="audit: seed of the first (default 0)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything")
    return parser


def _study(arguments: argparse.Namespace) -> int:
    known = {one.name: partial(study, one, _progress) for one in standard()}
    known |= {one.name: partial(moving.study, one, _progress) for one in moving.standard()}
    names = arguments.problem or ([] if arguments.nothing_else else list(known))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise CablecosimError(f"problem {unknown[0]!r} unknown; there are {', '.join(map(repr, known))}")
    studies = [known[name]() for name in names]
    if arguments.measured is not None:
        studies += [from_elsewhere(one) for one in json.loads(arguments.measured.read_text(encoding="utf-8"))]
    _progress("")
    sys.stdout.write(study_table(studies) + "\n")
    _write(arguments.json, study_json(studies))
    return 0


def _audit(arguments: argparse.Namespace) -> int:
    if arguments.cases < 1:
        raise CablecosimError(f"cases: {arguments.cases} must be 1 or more")
    results = []
    for done, one in enumerate(audit(range(arguments.first, arguments.first + arguments.cases)), 1):
        results.append(one)
        _progress(f"{done}/{arguments.cases} requests")
    _progress("")
    found = summaries(results)
    sys.stdout.write(audit_table(found) + "\n")
    _write(arguments.json, audit_json(results, found))
    return 0 if found[-1].is_true else 1


def _effects(arguments: argparse.Namespace) -> int:
    """Of a request that comes in through standard input."""
    from protocol.codec import decode
    from protocol.messages import ShapeRequest

    from .effect_costs import costs, costs_table

    request = decode(sys.stdin.buffer.read())
    if not isinstance(request, ShapeRequest):
        raise CablecosimError(f"a {type(request).__name__} has no effects; give a ShapeRequest")
    rows = costs(request)
    sys.stdout.write(costs_table(rows, request.tolerance) + "\n")
    _write(arguments.json, [asdict(row) for row in rows])
    return 0


def _write(file: Path | None, report: object) -> None:
    if file is not None:
        file.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def _progress(text: str) -> None:
    """A line that overwrites itself in a terminal; nothing elsewhere."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{text[:WIDTH]:{WIDTH}s}" + ("" if text else "\r"))
        sys.stderr.flush()


def _say(text: str) -> None:
    sys.stderr.write(f"accuracy: {text}\n")


if __name__ == "__main__":
    sys.exit(main())
