"""Run the catalogue of hard cases: `python -m shape_server.hard_cases`; exit code 1 if a case is wrong that was not known to be."""

from __future__ import annotations

import os

# As for the shape server: matrices are small, a second BLAS thread costs more than it saves.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from pathlib import Path
from typing import Final

from ..paths import CHOICES, is_compiled
from .case import Case
from .catalogue import catalogue, family_names
from .table import as_json, table
from .worker import Result, run

LIMIT: Final = {"compiled": 20.0, "numpy": 200.0}  # s for a case
NUMPY: Final = "the kernels are not compiled, so numpy solves, about twenty times slower; compile: python -m shape_server --warm-up\n"


def main() -> int:
    """Run what the command line asks for; 0 if nothing is wrong, 1 if something is, 2 for a mistake of the user's."""
    arguments = _parser().parse_args()
    if arguments.family not in (None, *family_names()):
        sys.stderr.write(f"hardcases: family {arguments.family!r} unknown; there are {', '.join(map(repr, family_names()))}\n")
        return 2
    if arguments.json is not None and not arguments.json.absolute().parent.is_dir():
        sys.stderr.write(f"hardcases: {arguments.json}: there is no such folder; give a file in a folder that exists\n")
        return 2
    cases = catalogue(arguments.family)
    if arguments.list:
        sys.stdout.writelines(f"{case.family}: {case.name}\n" for case in cases)
        return 0
    kernels = arguments.kernels
    if kernels == "auto":
        kernels = "compiled" if is_compiled() else "numpy"
        sys.stderr.write(NUMPY if kernels == "numpy" else "")
    try:
        results = _run(cases, kernels)
    except KeyboardInterrupt:
        sys.stderr.write("\nhardcases: interrupted\n")
        return 130
    sys.stdout.write(table(results) + "\n")
    if arguments.json is not None:
        arguments.json.write_text(as_json(results), encoding="utf-8")
    return int(any(result.is_silent for result in results))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="cablecosim hardcases", description="Solves hard cases and says how each of them ends.")
    parser.add_argument("--family", help="run one family only; --list names them")
    parser.add_argument("--list", action="store_true", help="print family and name of every case, and end")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every case with its ending, error, seconds and sentence")
    parser.add_argument("--kernels", choices=CHOICES, default="auto", help="auto: compiled if they are ready (default)")
    return parser


def _run(cases: tuple[Case, ...], kernels: str) -> list[Result]:
    """All results, with a line of progress that overwrites itself in a terminal, and one a family elsewhere."""
    results: list[Result] = []
    in_place = sys.stderr.isatty()
    for number, result in enumerate(run(cases, kernels, LIMIT[kernels]), 1):
        results.append(result)
        is_last = number == len(cases) or cases[number].family != result.case.family
        if in_place or is_last:
            text = f"{number}/{len(cases)} {result.case.family}"
            sys.stderr.write(f"\r{text:60s}" if in_place else f"{text}\n")
            sys.stderr.flush()
    if in_place:
        sys.stderr.write("\r" + " " * 60 + "\r")
    return results


if __name__ == "__main__":
    sys.exit(main())
