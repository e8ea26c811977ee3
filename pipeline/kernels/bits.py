"""Sixty-four cells at a time: compare bytes to a bit mask, add bytes up, count and find bits.

Plain LLVM vector instructions, so every processor that LLVM knows has them (AVX-512, AVX2, NEON, ...). The functions
that take addresses read and write exactly the bytes named; the caller keeps the arrays alive and in bounds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils

from pipeline.kernels.compiled import allocating

_BYTES = ir.VectorType(ir.IntType(8), 64)
intrinsic: Any = extending.intrinsic
_PAIRS = ir.VectorType(ir.IntType(16), 32)
_declared: Any = cgutils.get_or_insert_function


def _load(builder: Any, address: Any, kind: ir.Type) -> Any:
    value = builder.load(builder.inttoptr(address, kind.as_pointer()))
    value.align = 1
    return value


@intrinsic
def bits_above(typing: Any, cells: Any, limits: Any) -> Any:
    """Bit j is set when byte j of the 64 at address `cells` is greater than byte j at address `limits`."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        x, limit = (_load(builder, one, _BYTES) for one in words)
        return builder.bitcast(builder.icmp_unsigned(">", x, limit), ir.IntType(64))

    return types.uint64(types.uintp, types.uintp), build


@intrinsic
def bits_above_raised(typing: Any, cells: Any, limits: Any, raised: Any) -> Any:
    """As bits_above, with `raised` added to every limit (a limit past 255 stays 255, which nothing exceeds)."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        x, limit = (_load(builder, one, _BYTES) for one in words[:2])
        step = builder.trunc(words[2], ir.IntType(8))
        first = builder.insert_element(ir.Constant(_BYTES, ir.Undefined), step, ir.Constant(ir.IntType(32), 0))
        everywhere = builder.shuffle_vector(
            first, ir.Constant(_BYTES, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), 64), [0] * 64)
        )
        total = builder.add(limit, everywhere)
        past = builder.icmp_unsigned("<", total, everywhere)
        high = builder.select(past, ir.Constant(_BYTES, [255] * 64), total)
        return builder.bitcast(builder.icmp_unsigned(">", x, high), ir.IntType(64))

    return types.uint64(types.uintp, types.uintp, types.uint64), build


@intrinsic
def add_pairs(typing: Any, cells: Any, sums: Any) -> Any:
    """Add the 64 bytes at address `cells`, two neighbours together, to the 32 uint16 at address `sums` (128 times at
    most)."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        pairs = _load(builder, words[0], _PAIRS)
        low = builder.and_(pairs, ir.Constant(_PAIRS, [0xFF] * 32))
        high = builder.lshr(pairs, ir.Constant(_PAIRS, [8] * 32))
        total = builder.add(_load(builder, words[1], _PAIRS), builder.add(low, high))
        builder.store(total, builder.inttoptr(words[1], _PAIRS.as_pointer()), align=2)
        return context.get_dummy_value()

    return types.void(types.uintp, types.uintp), build


def _four_rows(builder: Any, words: Any) -> None:
    cells, cells_step, sums, bits_step, *masks = words
    limits = [(_load(builder, limit, _BYTES), bits) for limit, bits in zip(masks[::2], masks[1::2], strict=True)]
    rows, at = [], cells
    for _ in range(4):
        rows.append(_load(builder, at, _PAIRS))
        at = builder.add(at, cells_step)
    # low + high of every pair is pair - 255 * high, in 16 bits whatever the sum of the pairs runs over to
    eight = ir.Constant(_PAIRS, [8] * 32)
    highs = [builder.lshr(one, eight) for one in rows]
    pairs, high = (builder.add(builder.add(four[0], four[1]), builder.add(four[2], four[3])) for four in (rows, highs))
    total = builder.sub(builder.add(pairs, high), builder.shl(high, eight))
    total = builder.add(_load(builder, sums, _PAIRS), total)
    builder.store(total, builder.inttoptr(sums, _PAIRS.as_pointer()), align=2)
    word = ir.IntType(64)
    for limit, first in limits:
        at = first
        for one in rows:
            above = builder.icmp_unsigned(">", builder.bitcast(one, _BYTES), limit)
            builder.store(builder.bitcast(above, word), builder.inttoptr(at, word.as_pointer()), align=8)
            at = builder.add(at, bits_step)


@intrinsic
def compare_and_add_four(
    typing: Any, cells: Any, cells_step: Any, sums: Any, bits_step: Any, limits: Any, bits: Any
) -> Any:
    """`bits_above` and `add_pairs` for the same 64 cells of four rows: the limits and sums are taken up once.

    The rows' cells lie cells_step bytes apart, the words for their bits bits_step bytes. Adds up to four times 510 to
    the sums.
    """

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        _four_rows(builder, words)
        return context.get_dummy_value()

    return types.void(*[types.uintp] * 6), build


@intrinsic
def compare_twice_and_add_four(
    typing: Any,
    cells: Any,
    cells_step: Any,
    sums: Any,
    bits_step: Any,
    limits: Any,
    bits: Any,
    lower: Any,
    grown: Any,
) -> Any:
    """As compare_and_add_four, and at address `grown` the bits above the limits at address `lower`."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        _four_rows(builder, words)
        return context.get_dummy_value()

    return types.void(*[types.uintp] * 8), build


@intrinsic
def borrowed(typing: Any, array: Any) -> Any:
    """The same array without reference counting: handing it (or slices of it) to another kernel costs no atomic
    operation.

    Only for arrays that outlive the kernel, which arguments from Python do.
    """

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, value=words[0])
        view.meminfo = ir.Constant(view.meminfo.type, None)
        view.parent = ir.Constant(view.parent.type, None)
        return view._getvalue()

    return array(array), build


@intrinsic
def trailing_zeros(typing: Any, word: Any) -> Any:
    """Position of the lowest set bit; 64 for an empty word."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        return builder.cttz(words[0], ir.Constant(ir.IntType(1), 0))

    return types.uint64(types.uint64), build


@intrinsic
def set_bits(typing: Any, word: Any) -> Any:
    """How many bits are set."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        return builder.ctpop(words[0])

    return types.uint64(types.uint64), build


@allocating
def bits_of_row(cells: Any, limits_at: int, bits: Any, tail: Any) -> Any:
    """Fill one row of words with the cells that exceed their limits, and tell whether any does.

    cells: (ranges) uint8. limits_at: address of the row's limits, 64 bytes a word. bits: (words) uint64. tail: 64 bytes
    of which those past the row's rest are 0; those before are overwritten.
    """
    cells_at, tail_at = cells.ctypes.data, tail.ctypes.data
    whole = cells.size // 64
    rest = cells.size - 64 * whole
    anything = np.uint64(0)
    for w in range(whole):
        at = np.uintp(64 * w)
        word = bits_above(cells_at + at, limits_at + at)
        bits[w] = word
        anything |= word
    if rest:
        for j in range(rest):
            tail[j] = cells[64 * whole + j]
        word = bits_above(tail_at, limits_at + np.uintp(64 * whole))
        bits[whole] = word
        anything |= word
    return anything != np.uint64(0)


@intrinsic
def filled_words(typing: Any, words: Any) -> Any:
    """Bit w is set when word w of the 8 at address `words` has any bit set."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        kind = ir.VectorType(ir.IntType(64), 8)
        filled = builder.icmp_unsigned("!=", _load(builder, given[0], kind), ir.Constant(kind, [0] * 8))
        return builder.zext(builder.bitcast(filled, ir.IntType(8)), ir.IntType(64))

    return types.uint64(types.uintp), build


@intrinsic
def fetch_ahead(typing: Any, address: Any) -> Any:
    """Ask for the cache line at an address that will be read soon; an address that cannot be read does no harm."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        fetch = _declared(builder.module, kind, "llvm.prefetch.p0i8")
        read, keep, data = (ir.Constant(number, one) for one in (0, 3, 1))
        builder.call(fetch, [builder.inttoptr(words[0], pointer), read, keep, data])
        return context.get_dummy_value()

    return types.void(types.uintp), build


@intrinsic
def runs_in_eight(typing: Any, bits: Any, before: Any) -> Any:
    """How many runs of set bits begin in the eight words at address `bits`, `before` being the word before them."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        kind = ir.VectorType(ir.IntType(64), 8)
        one, top = ir.Constant(kind, [1] * 8), ir.Constant(kind, [63] * 8)
        here = _load(builder, words[0], kind)
        first = builder.insert_element(ir.Constant(kind, ir.Undefined), words[1], ir.Constant(ir.IntType(32), 0))
        back = builder.shuffle_vector(first, here, ir.Constant(ir.VectorType(ir.IntType(32), 8), [0, *range(8, 15)]))
        inside = builder.or_(builder.shl(here, one), builder.lshr(back, top))
        starts = builder.and_(here, builder.not_(inside))
        count = _declared(builder.module, ir.FunctionType(kind, [kind]), "llvm.ctpop.v8i64")
        total = _declared(builder.module, ir.FunctionType(ir.IntType(64), [kind]), "llvm.vector.reduce.add.v8i64")
        return builder.call(total, [builder.call(count, [starts])])

    return types.uint64(types.uintp, types.uint64), build


@allocating
def count_runs(mask: Any) -> Any:
    """Number of runs of set bits in one row of words."""
    runs = types.uint64(0)  # with a signed 0 numba would count in floating point
    before = types.uint64(0)
    one = types.uint64(1)
    whole = mask.size // 8
    for eight in range(whole):
        runs += runs_in_eight(mask.ctypes.data + np.uintp(64 * eight), before)
        before = mask[np.uintp(8 * eight + 7)]
    for w in range(8 * whole, mask.size):
        word = mask[w]
        runs += set_bits(word & ~((word << one) | (before >> types.uint64(63))))
        before = word
    return types.int64(runs)
