"""The shell: sockets, clocks, threads, database and screens around the functional core in `pipeline`."""

from app.kernel_cache import use_kernel_cache

use_kernel_cache()
