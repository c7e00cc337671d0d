"""Before any test: compiled code of other sources than these is forgotten."""

from __future__ import annotations

from shape_server.paths import forget_stale_kernels

forget_stale_kernels()
