"""How kernels are compiled: each set of flags has one name, and every kernel is decorated with one of them.

A kernel is a function at module level. What it works with comes as arguments, never by closure: numba's cache on disk
misses a closure in every new process. All kernels run without the interpreter's lock, on the thread of their caller,
and are kept on disk (`app.kernel_cache` says where).
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from functools import partial
from typing import Any, ParamSpec, Protocol, TypeVar

from numba import njit
from numba.core.caching import IndexDataCacheFile

Given = ParamSpec("Given")
Result = TypeVar("Result")


def own_file_name(cache: Any, number: int) -> str:
    """The name of the file for one more compiled kernel of a cache on disk: no other file is ever called so.

    numba numbers them from the index that it read before it compiled. Two processes that compile the same kernel for
    different arguments at once then give both the same number, and the index may tell either that the file is its own:
    code for arrays without gaps would work on arrays with gaps, and read what does not belong to them.
    """
    return str(cache._data_name_pattern.format(number=number)).replace(f".{number}.", f".{uuid.uuid4().hex}.")


IndexDataCacheFile._data_name = own_file_name  # type: ignore[method-assign]


class Decorator(Protocol):
    """What compiles a function; its callers are checked against the annotations of the function."""

    def __call__(self, function: Callable[Given, Result], /) -> Callable[Given, Result]: ...  # noqa: D102


_compiled: Any = partial(njit, nogil=True, cache=True)

allocating: Decorator = _compiled
"""With numba's reference counting: the kernel may allocate arrays, and may be handed any array.

The one to begin with. Each slice that is handed to another kernel costs an atomic increment and decrement, which is
felt where it happens once a sweep or once a run; there `kernel` is faster.
"""

kernel: Any = partial(_compiled, _nrt=False)
"""Without numba's reference counting: handing slices to another kernel costs nothing, and an allocation in a kernel is
a compile error.

For kernels that only read and write what they are given, and call others with slices of it in their inner loops.
"""

inlined: Any = partial(kernel, forceinline=True)
"""As `kernel`, for a function so small, or called with so many arguments, that a call would cost more than it does."""

unchecked_division: Decorator = partial(_compiled, error_model="numpy")
"""As `allocating`, but a division by zero gives an infinity or nan, as in numpy, instead of an exception.

Without the test for zero loops with divisions become vector instructions. Only where no divisor can be zero, or where
what comes of it is dealt with.
"""

reassociating: Decorator = partial(_compiled, fastmath=True)
"""As `allocating`, but the compiler may add and multiply floating point numbers in another order, and takes it that
none of them is nan or infinite.

So sums over an array become vector instructions. The last bits of a result then depend on the processor that compiled
it: only for scores that are compared with a tolerance, and only where every number is finite.
"""
