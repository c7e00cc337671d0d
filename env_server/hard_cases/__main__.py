"""The environment's hard cases, by numbers from standard input (`protocol.hard_case.serve`); `cablecosim hardcases` asks for them."""

from __future__ import annotations

import argparse
import signal

from protocol.hard_case import serve

from .. import touch
from ..asking import Asker
from .catalogue import catalogue

PATIENCE = 60.0  # s that a shape server may be silent


def main() -> None:
    """Answer until nobody asks any more."""
    parser = argparse.ArgumentParser(prog="python -m env_server.hard_cases", description="Plays hard cases by their numbers.")
    parser.add_argument("--shape", metavar="ADDRESS", default="", help="the shape server to ask")
    address = parser.parse_args().shape
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks decides when to end

    def prepare() -> tuple[Asker, str]:
        touch.warm_up()
        asker = Asker(address, patience=PATIENCE)
        kernels = asker.greet(PATIENCE)
        return asker, "compiled" if kernels == "compiled" else "numpy"

    serve(catalogue(), prepare)


if __name__ == "__main__":
    main()
