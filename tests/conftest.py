"""Before any test: the kernels are compiled, or loaded if they are those of these sources, so that no test is timed with the compiler."""

from __future__ import annotations

from shape_server.paths import compile_kernels

compile_kernels()
