"""Eight tiles of eight cells at a time, for a threshold that is a cell's own offset plus the rule of its tile.

A tile is eight neighbouring range cells over some rows. The rule of a tile is eight bytes: the places below. Amplitudes
and limits are taken as signed bytes (less 128), and every sum saturates. Plain LLVM vector instructions, as in
`pipeline.kernels.bits`; the addresses are of bytes that the caller keeps alive.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.core import cgutils

BASE, FLOOR, MEAN, WET, KEEP, CENTRE, LEAST, CLASS = range(8)
"""base: limit of a cell of offset 0. floor: least limit of any cell; 127 shows nothing. mean: clutter mean of a cell of
offset 0. wet: least clutter mean of any cell. Of the residual, amplitude less offset and mean: keep: up to it a cell
counts for the means, and its offset follows; least: it is raised to this; centre: what it is in the mean. class: 0 to
3, which gain and bound the tile's offsets have, and FREE or STILL. In class 3 a cell whose own mean is below the wet
one counts as if it were at the centre: it tells of the rain alone, nothing of the walls beside it."""

FREE, STILL = 4, 8
"""Added to the class of a tile whose offsets follow whatever comes, or nothing."""

_WORD = ir.IntType(64)
_BYTE = ir.IntType(8)
_CELLS = ir.VectorType(_BYTE, 64)
_WIDE = ir.VectorType(ir.IntType(16), 64)
_LANES = {16: ir.VectorType(ir.IntType(16), 32), 32: ir.VectorType(ir.IntType(32), 16), 64: ir.VectorType(_WORD, 8)}
intrinsic: Any = extending.intrinsic
_declared: Any = cgutils.get_or_insert_function


class _Vectors:
    """Vector arithmetic in the LLVM builder of one function."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def load(self, address: Any) -> Any:
        value = self.builder.load(self.builder.inttoptr(address, _CELLS.as_pointer()))
        value.align = 1
        return value

    def store(self, value: Any, address: Any) -> None:
        self.builder.store(value, self.builder.inttoptr(address, value.type.as_pointer()), align=1)

    def all(self, number: int, kind: Any = _CELLS) -> Any:
        return ir.Constant(kind, [number] * kind.count)

    def signed(self, cells: Any) -> Any:
        return self.builder.xor(cells, self.all(-128))

    def saturated(self, which: str, a: Any, b: Any) -> Any:
        kind = a.type
        name = f"llvm.{which}.sat.v64i{kind.element.width}"
        function = _declared(self.builder.module, ir.FunctionType(kind, [kind, kind]), name)
        return self.builder.call(function, [a, b])

    def greater(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.icmp_signed(">", a, b), a, b)

    def less(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.icmp_signed("<", a, b), a, b)

    def of_tile(self, rules: Any, place: int) -> Any:
        """One byte of each of the eight rules, over the eight cells of its tile."""
        places = ir.Constant(ir.VectorType(ir.IntType(32), 64), [8 * (cell // 8) + place for cell in range(64)])
        return self.builder.shuffle_vector(rules, rules, places)

    def everywhere(self, byte: Any) -> Any:
        first = self.builder.insert_element(ir.Constant(_CELLS, ir.Undefined), byte, ir.Constant(ir.IntType(32), 0))
        return self.builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(ir.IntType(32), 64), [0] * 64))

    def of_class(self, classes: Any, four: Any) -> Any:
        """The byte that a word holds for each cell's class, 0 to 3."""
        made = None
        classes = self.builder.and_(classes, self.all(3))
        for number in range(4):
            byte = self.builder.trunc(self.builder.lshr(four, ir.Constant(_WORD, 8 * number)), _BYTE)
            value = self.everywhere(byte)
            is_it = self.builder.icmp_unsigned("==", classes, self.all(number))
            made = value if made is None else self.builder.select(is_it, value, made)
        return made

    def sum_of_tiles(self, cells: Any) -> Any:
        """(8) uint64: the sum of the eight unsigned bytes of each tile."""
        total = cells
        for width, kind in _LANES.items():
            total = self.builder.bitcast(total, kind)
            half = width // 2
            low = self.builder.and_(total, self.all((1 << half) - 1, kind))
            total = self.builder.add(low, self.builder.lshr(total, self.all(half, kind)))
        return total

    def mean_of_tiles(self, cells: Any) -> Any:
        """The mean of the eight signed bytes of each tile, rounded, over the cells of the tile."""
        total = self.sum_of_tiles(self.signed(cells))
        rounded = self.builder.sub(total, self.all(8 * 128 - 4, _LANES[64]))
        mean = self.builder.ashr(rounded, self.all(3, _LANES[64]))
        return self.of_tile(self.builder.bitcast(mean, _CELLS), 0)

    def count_of_tiles(self, chosen: Any) -> Any:
        """(8) uint64: how many of the eight cells of each tile are chosen."""
        bits = self.builder.bitcast(self.builder.bitcast(chosen, _WORD), ir.VectorType(_BYTE, 8))
        kind = ir.VectorType(_BYTE, 8)
        function = _declared(self.builder.module, ir.FunctionType(kind, [kind]), "llvm.ctpop.v8i8")
        return self.builder.zext(self.builder.call(function, [bits]), _LANES[64])

    def strictly(self, classes: Any) -> Any:
        """Class 1 instead of a greater one, and not FREE."""
        number = self.less(self.builder.and_(classes, self.all(3)), self.all(1))
        return self.builder.or_(number, self.builder.and_(classes, self.all(STILL)))

    def limits(self, offset: Any, rules: Any) -> Any:
        own = self.saturated("sadd", offset, self.of_tile(rules, BASE))
        return self.greater(own, self.of_tile(rules, FLOOR))

    def bits(self, cells: Any, limits: Any) -> Any:
        return self.builder.bitcast(self.builder.icmp_signed(">", cells, limits), _WORD)


@intrinsic
def tile_bits(typing: Any, cells: Any, offsets: Any, rules: Any) -> Any:
    """Bit j is set where cell j of the 64 at `cells` exceeds the limit of its offset (at `offsets`) and its tile."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        vectors = _Vectors(builder)
        cells, offset, rules = (vectors.load(one) for one in words)
        return vectors.bits(vectors.signed(cells), vectors.limits(offset, rules))

    return types.uint64(types.uintp, types.uintp, types.uintp), build


@intrinsic
def tile_bits_lowered(typing: Any, cells: Any, offsets: Any, rules: Any, drops: Any) -> Any:
    """As tile_bits, with the 64 bytes (0 to 127) at `drops` taken off the limits."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        vectors = _Vectors(builder)
        cells, offset, rules, drops = (vectors.load(one) for one in words)
        lower = vectors.saturated("ssub", vectors.limits(offset, rules), drops)
        return vectors.bits(vectors.signed(cells), lower)

    return types.uint64(types.uintp, types.uintp, types.uintp, types.uintp), build


@intrinsic
def tile_limits(typing: Any, offsets: Any, rules: Any, limits: Any) -> Any:
    """Write the 64 limits that tile_bits compares with to address `limits`, as unsigned bytes."""

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        vectors = _Vectors(builder)
        offset, rules = (vectors.load(one) for one in words[:2])
        vectors.store(vectors.signed(vectors.limits(offset, rules)), words[2])
        return context.get_dummy_value()

    return types.void(types.uintp, types.uintp, types.uintp), build


@intrinsic
def learn_tiles(
    typing: Any, cells: Any, offsets: Any, fine: Any, rules: Any, sums: Any, strict: Any, gains: Any, most: Any
) -> Any:
    """Let 64 offsets follow their cells, and add to the sums of their eight tiles.

    An offset is the signed byte at `offsets` and 1/256 steps at `fine`. sums: address of 8 uint64: cells that count,
    16 bits; the sum of their residuals above `least` of the rule, 24 bits; of their magnitudes, 24 bits. gains: four
    bytes, in 1/256, of the classes, and a fifth, with which the cells of class 0 follow the mean of their eight as
    well; most: four bytes, their greatest offsets. strict: 64 bits, the cells that are
    not FREE, and of class 1 where their tile is of a greater one.
    """

    def build(context: Any, builder: Any, signature: Any, words: Any) -> Any:
        vectors = _Vectors(builder)
        cells, offset, fine, rules = (vectors.load(one) for one in words[:4])
        place = [vectors.of_tile(rules, number) for number in range(8)]
        nothing = vectors.all(0)
        own = vectors.saturated("sadd", offset, place[MEAN])
        residual = vectors.saturated("ssub", vectors.signed(cells), vectors.greater(own, place[WET]))
        kept = builder.icmp_signed("<=", residual, place[KEEP])
        last = builder.icmp_unsigned("==", builder.and_(place[CLASS], vectors.all(3)), vectors.all(3))
        drowned = builder.and_(last, builder.icmp_signed("<", own, place[WET]))
        residual = builder.select(drowned, place[CENTRE], residual)
        bounded = vectors.greater(residual, place[LEAST])

        magnitude = builder.select(builder.icmp_signed("<", bounded, nothing), builder.sub(nothing, bounded), bounded)
        count = vectors.count_of_tiles(kept)
        first = vectors.sum_of_tiles(builder.select(kept, builder.sub(bounded, place[LEAST]), nothing))
        second = vectors.sum_of_tiles(builder.select(kept, magnitude, nothing))
        lanes = _LANES[64]
        packed = builder.or_(
            builder.or_(count, builder.shl(first, vectors.all(16, lanes))),
            builder.shl(second, vectors.all(40, lanes)),
        )
        before = builder.load(builder.inttoptr(words[4], lanes.as_pointer()))
        before.align = 8
        builder.store(builder.add(before, packed), builder.inttoptr(words[4], lanes.as_pointer()), align=8)

        error = vectors.saturated("ssub", bounded, place[CENTRE])
        strict = builder.bitcast(words[5], ir.VectorType(ir.IntType(1), 64))
        flags = builder.select(strict, vectors.strictly(place[CLASS]), place[CLASS])
        free, still = (
            builder.icmp_unsigned("!=", builder.and_(flags, vectors.all(flag)), nothing) for flag in (FREE, STILL)
        )
        follows = builder.and_(builder.or_(kept, free), builder.not_(still))
        error = builder.select(follows, error, nothing)
        gain = builder.zext(vectors.of_class(flags, words[6]), _WIDE)
        change = builder.mul(builder.sext(error, _WIDE), gain)
        alike = builder.icmp_unsigned("==", builder.and_(flags, vectors.all(3)), nothing)
        common = builder.select(builder.and_(alike, follows), vectors.mean_of_tiles(error), nothing)
        gain = vectors.everywhere(builder.trunc(builder.lshr(words[6], ir.Constant(_WORD, 32)), _BYTE))
        change = vectors.saturated("sadd", change, builder.mul(builder.sext(common, _WIDE), builder.zext(gain, _WIDE)))
        eight = vectors.all(8, _WIDE)
        whole = builder.or_(builder.shl(builder.sext(offset, _WIDE), eight), builder.zext(fine, _WIDE))
        moved = vectors.saturated("sadd", whole, change)
        bound = builder.shl(builder.sext(vectors.of_class(flags, words[7]), _WIDE), eight)
        moved = vectors.less(moved, bound)
        vectors.store(builder.trunc(builder.ashr(moved, eight), _CELLS), words[1])
        vectors.store(builder.trunc(moved, _CELLS), words[2])
        return context.get_dummy_value()

    address = types.uintp
    return types.void(address, address, address, address, address, types.uint64, types.uint64, types.uint64), build
