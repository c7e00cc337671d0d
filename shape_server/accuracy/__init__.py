"""What accuracy costs in time: true errors against independent references, beside the CPU time that each setting takes."""

from __future__ import annotations

from .audit import audit as audit
from .study import study as study
