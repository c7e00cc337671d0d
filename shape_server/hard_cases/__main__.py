"""The shape server's hard cases, by numbers from standard input (`protocol.hard_case.serve`); `cablecosim hardcases` asks for them."""

from __future__ import annotations

import argparse
import signal
from types import ModuleType

from protocol.hard_case import serve

from .. import blas
from ..paths import CHOICES, Paths, is_compiled
from .catalogue import catalogue, warm_up


def main() -> None:
    """Answer until nobody asks any more."""
    blas.use_one_thread()
    parser = argparse.ArgumentParser(prog="python -m shape_server.hard_cases", description="Solves hard cases by their numbers.")
    parser.add_argument("--kernels", choices=CHOICES, default="auto", help="auto: compiled if they are ready (default)")
    asked = parser.parse_args().kernels
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks decides when to end

    def prepare() -> tuple[ModuleType, str]:
        kernels = asked if asked != "auto" else "compiled" if is_compiled() else "numpy"
        path = Paths(kernels).current
        warm_up(path)
        return path, kernels

    serve(catalogue(), prepare)


if __name__ == "__main__":
    main()
