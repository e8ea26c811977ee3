"""Fragments: whole datagrams or none, whatever is lost and however the identifications come again."""

from collections import Counter
from itertools import permutations

import pytest

from app.ingest.containers.fragments import MAX_AGE_S, MAX_BETWEEN, MAX_OPEN, Fragments

SENDER = b"\x0a\0\0\1\x0a\0\0\2"
SIZE = 64


def payload(number: int) -> bytes:
    return number.to_bytes(2, "big") * SIZE


Piece = tuple[int, int, bool, bytes]
"""(number of the datagram, offset, more to come, octets)"""


def pieces(number: int, count: int = 2) -> list[Piece]:
    whole, step = payload(number), 2 * SIZE // count
    return [(number, at, at + step < len(whole), whole[at : at + step]) for at in range(0, len(whole), step)]


def run(stream: list[Piece], idents: int = 65536, pace: float = 1e-3) -> tuple[list[bytes], Counter[str]]:
    """What is made of a stream whose sender has so many identifications; a datagram begins every `pace` seconds."""
    counters = Counter[str]()
    fragments = Fragments(counters)
    made = []
    for number, offset, more, data in stream:
        one = fragments.add(SENDER, (number % idents).to_bytes(2, "big"), offset, more, data, number * pace)
        if one is not None:
            made.append(one)
    fragments.finish()
    return made, Counter({name: count for name, count in counters.items() if count})


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_pieces_come_in_any_order(order: tuple[int, ...]) -> None:
    stream = [pieces(n, 4)[i] for n in range(3) for i in order]
    made, counted = run(stream)
    assert made == [payload(n) for n in range(3)]
    assert counted == {"fragments": 12}


@pytest.mark.parametrize("idents", [65536, 256, 64, 16, 2, 1])
@pytest.mark.parametrize("count", [2, 4])
@pytest.mark.parametrize("lost", [0, 1, -1])
def test_no_datagram_is_made_of_two(idents: int, count: int, lost: int) -> None:
    """Every seventh loses a piece. The first of a sender is whole, so that it is known how it counts."""
    stream, gone = list[Piece](), set[int]()
    for n in range(600):
        parts = pieces(n, count)
        if n > 2 * min(idents, MAX_BETWEEN) and n % 7 == 0:
            del parts[lost]
            gone.add(n)
        stream += parts
    made, counted = run(stream, idents)
    assert made == [payload(n) for n in range(600) if n not in gone]
    assert counted["fragments_lost"] == len(gone)


def test_what_is_left_of_a_datagram_is_not_completed_after_its_time() -> None:
    first, second = pieces(0)
    counters = Counter[str]()
    for late, whole in ((0.9 * MAX_AGE_S, True), (1.1 * MAX_AGE_S, False)):
        fragments = Fragments(counters)
        assert fragments.add(SENDER, b"\0\1", *second[1:], 5.0) is None
        assert (fragments.add(SENDER, b"\0\1", *first[1:], 5.0 + late) is not None) == whole
    assert counters["fragments_lost"] == 1


def test_without_times_the_datagrams_between_decide() -> None:
    stream = [pieces(0)[1], *[one for n in range(1, MAX_BETWEEN + 2) for one in pieces(n)], pieces(0)[0]]
    made, counted = run(stream, pace=float("nan"))
    assert made == [payload(n) for n in range(1, MAX_BETWEEN + 2)]
    assert counted["fragments_lost"] == 2


def test_fragments_that_were_captured_twice_are_counted_and_do_no_harm() -> None:
    stream = [one for n in range(100) for piece in pieces(n) for one in (piece, piece)]
    made, counted = run(stream)
    assert made == [payload(n) for n in range(100)]
    assert counted == {"fragments": 400, "fragments_double": 200}


def test_pieces_that_overlap_with_other_octets_are_of_two_datagrams() -> None:
    (_, _, _, data), last = pieces(1)
    stream = [(5, 0, True, data), (5, 8, True, data), (5, 8 + SIZE, False, last[3])]
    made, counted = run(stream)
    assert made == []
    assert counted == {"fragments": 3, "fragments_lost": 2}


def test_pieces_beyond_the_end_and_empty_ones_are_not_taken() -> None:
    stream = [(1, 65528, False, bytes(16)), (2, 0, True, b"")]
    made, counted = run(stream)
    assert made == []
    assert counted == {"fragments": 2, "damaged": 2}
    head, tail = pieces(3)
    made, counted = run([tail, (3, 2 * SIZE, False, b"more"), head])
    assert (made, counted["fragments_lost"]) == ([], 3)


def test_what_may_be_open_is_bounded() -> None:
    stream = [pieces(n)[0] for n in range(3 * MAX_OPEN)]
    counters = Counter[str]()
    fragments = Fragments(counters)
    for number, offset, more, data in stream:
        fragments.add(number.to_bytes(8, "big"), b"\0\1", offset, more, data, 0.0)
    assert counters["fragments_lost"] == 2 * MAX_OPEN
    fragments.finish()
    assert counters["fragments_lost"] == 3 * MAX_OPEN
