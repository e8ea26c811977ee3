"""Functions and files are short. A kernel may be long where a call in its loop, or a second pass, would cost time."""

from __future__ import annotations

from tests.house.rules import long_functions, sources

MOST_LINES = 60
"""Of a function: one screen."""

MOST_LINES_OF_A_FILE = 400

LONG_KERNELS = {
    "pipeline/detect/hybrid.py: _detect": "one pass over a sweep judges and learns; half of it unpacks its arguments",
    "pipeline/kernels/adaptive.py: detect": "one pass over a sweep judges and learns; half of it unpacks its arguments",
    "pipeline/kernels/adaptive.py: update_patches": "one vector loop over all patches; a second would read them again",
    "pipeline/kernels/assignment.py: assign_sparse": "one shortest augmenting path; its steps share all their state",
    "pipeline/kernels/plot_shape.py: measure_plot": "one walk over the runs of a plot sums up all its attributes",
    "pipeline/kernels/tiles.py: learn_tiles": "writes one straight run of vector instructions, each used by the next",
    "pipeline/lab/simulate/video.py: _illuminate": "one loop over the cells of an echo, with all that each cell needs",
}
"""Kernels of more lines, with the reason."""

LONG_FILES: dict[str, str] = {}
"""Files of more lines, with the reason."""

FILES = sources("app", "pipeline")


def function_faults(files: dict[str, str], excepted: dict[str, str], most: int = MOST_LINES) -> list[str]:
    """Long functions that are not excepted, or are no kernel; exceptions without a reason or that nothing needs."""
    long = {f"{path}: {name}": one for path, text in files.items() for name, one in long_functions(text, most).items()}
    return [
        *(f"{name} has {lines} lines" for name, (lines, _) in long.items() if name not in excepted),
        *(f"{name} is no kernel" for name, (_, kernel) in long.items() if name in excepted and not kernel),
        *(f"{name} is not long" for name in excepted if name not in long),
        *(f"{name} has no reason" for name, reason in excepted.items() if not reason.strip()),
    ]


def file_faults(files: dict[str, str], excepted: dict[str, str], most: int = MOST_LINES_OF_A_FILE) -> list[str]:
    """Long files that are not excepted; exceptions without a reason or that nothing needs."""
    long = {path: lines for path, text in files.items() if (lines := len(text.splitlines())) > most}
    return [
        *(f"{path} has {lines} lines" for path, lines in long.items() if path not in excepted),
        *(f"{path} is not long" for path in excepted if path not in long),
        *(f"{path} has no reason" for path, reason in excepted.items() if not reason.strip()),
    ]


def test_functions_are_short() -> None:
    assert function_faults(FILES, LONG_KERNELS) == []


def test_files_are_short() -> None:
    assert len(FILES) > 250
    assert file_faults(FILES, LONG_FILES) == []


SOURCE = """
from pipeline.kernels.compiled import allocating

@allocating
def kernel(a):
    b = a
    return b

class Part:
    @property
    def long(self):
        b = 1
        return b

    async def short(self):
        return 1

def outer():
    if 1:
        def inner():
            b = 1
            return b
"""


def test_long_functions_are_found_wherever_they_stand() -> None:
    assert long_functions(SOURCE, 2) == {
        "kernel": (3, True), "Part.long": (3, False), "outer": (5, False), "outer.inner": (3, False)
    }  # fmt: skip
    assert long_functions(SOURCE, 3) == {"outer": (5, False)}


def test_only_kernels_are_excepted_and_only_with_a_reason() -> None:
    files = {"a.py": SOURCE}
    assert function_faults(files, {}, 4) == ["a.py: outer has 5 lines"]
    assert function_faults(files, {"a.py: outer": "it is"}, 4) == ["a.py: outer is no kernel"]
    assert function_faults(files, {}, 5) == []
    assert function_faults(files, {"a.py: kernel": "one pass"}, 5) == ["a.py: kernel is not long"]
    only = {"a.py": SOURCE[: SOURCE.index("class")]}
    assert function_faults(only, {"a.py: kernel": "one pass"}, 2) == []
    assert function_faults(only, {"a.py: kernel": " "}, 2) == ["a.py: kernel has no reason"]


def test_long_files_are_found() -> None:
    files = {"a.py": "1\n" * 3, "b.py": "1\n" * 4}
    assert file_faults(files, {}, 3) == ["b.py has 4 lines"]
    assert file_faults(files, {"b.py": "generated"}, 3) == []
    assert file_faults(files, {"a.py": "generated", "b.py": ""}, 3) == ["a.py is not long", "b.py has no reason"]
