"""Before any test imports a kernel: the cache of compiled kernels is that of exactly these sources."""

import app  # noqa: F401
