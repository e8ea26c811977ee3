"""Where the targets were in the last hour, in the forms in which tar1090 asks for it when its page is opened.

tar1090 reads `chunks/chunks.json` and the chunks that it names; where there are none, `data/history_N.json`, as
dump1090 writes them. A chunk is an object with the single documents in `files`.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Callable

from app.wire import Row, encode
from pipeline.picture import Picture

INTERVAL_S = 8.0
"""Between two documents, as tar1090's own script does it by default."""

KEPT_S = 3600.0
"""What is shown when a page is opened, as there."""

CHUNK_DOCUMENTS = 60
"""Of one chunk: eight minutes."""

THINNED = 4
"""Every so many documents one is a file `history_N.json`: 32 s, as dump1090 does it; each is a request of its own."""

GZIP_BITS = 31
"""Window of zlib with the head and tail of gzip."""

SPEED_LEVEL = 1
"""zlib's quickest level: a document of a thousand targets takes two milliseconds."""

CURRENT = "current.json"


class Trails:
    """Keeps what `document` tells of the pictures it is shown. For the event loop."""

    def __init__(self, document: Callable[[Picture], Row]) -> None:
        self._document = document
        self._begin()

    def _begin(self) -> None:
        self._newest = float("-inf")
        self._chunks: deque[tuple[str, bytes]] = deque(maxlen=round(KEPT_S / INTERVAL_S / CHUNK_DOCUMENTS))
        self._files: deque[bytes] = deque(maxlen=round(KEPT_S / INTERVAL_S / THINNED))
        self._seen = 0
        self._open_chunk()

    def _open_chunk(self) -> None:
        self._open = zlib.compressobj(SPEED_LEVEL, wbits=GZIP_BITS)
        self._written = self._open.compress(b'{"files":[')
        self._in_chunk = 0

    def show(self, picture: Picture) -> None:
        """Take a picture; a time before the newest begins anew, as after a seek in a recording."""
        if picture.time < self._newest:
            self._begin()
        if picture.time < self._newest + INTERVAL_S:
            return
        self._newest = picture.time
        document = encode(self._document(picture))
        if self._seen % THINNED == 0:
            self._files.append(zlib.compress(document, SPEED_LEVEL, wbits=GZIP_BITS))
        self._seen += 1
        self._written += self._open.compress((b"," if self._in_chunk else b"") + document)
        self._in_chunk += 1
        if self._in_chunk == CHUNK_DOCUMENTS:
            self._chunks.append((f"chunk_{round(1000 * picture.time)}.json", self._current()))
            self._open_chunk()

    def names(self) -> list[str]:
        """The chunks, oldest first."""
        return [*(name for name, _ in self._chunks), CURRENT]

    def chunk(self, name: str) -> bytes | None:
        """The gzipped JSON of a chunk; None when there is none of this name."""
        return self._current() if name == CURRENT else dict(self._chunks).get(name)

    @property
    def files(self) -> int:
        """How many files `history_N.json` there are."""
        return len(self._files)

    def file(self, number: int) -> bytes | None:
        """The gzipped JSON of such a file, 0 for the oldest; None when there is none of this number."""
        return self._files[number] if 0 <= number < len(self._files) else None

    def _current(self) -> bytes:
        end = self._open.copy()
        return self._written + end.compress(b"]}") + end.flush()
