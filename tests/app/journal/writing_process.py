"""Writes a journal until it is killed. Tells on standard output how many octets are in its file."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

from app.journal.writer import JournalWriter
from tests.app.journal.writing import ATTACHMENTS, LIMITS, put


def main() -> None:
    writer = JournalWriter(Path(sys.argv[1]), ATTACHMENTS, replace(LIMITS, chunk_age_s=0.2))
    number = 0
    while True:
        put(writer, "snapshot" if writer.wants_snapshot else "event", number)
        number += 1
        time.sleep(0.002)
        if number % 100 == 0:
            print(writer.state().counters.octets, flush=True)


if __name__ == "__main__":
    main()
