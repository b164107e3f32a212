"""Bounds on a command that reads what somebody else may have written: the machine outlives whatever is in a file."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pretouch.errors import PretouchError

READERS = frozenset({"detect", "identify", "replay", "report", "robot"})
"""Commands that read files from elsewhere."""
_SHARE = 0.5
"""Share of the memory that is free which such a command may take."""
_FILE = 4 << 30
"""Largest file that it may write, one that a library unpacks on the way included [bytes]."""


@contextmanager
def bounded(command: str) -> Iterator[None]:
    """Bound memory and files of this process while a command reads; what it would take beyond is a PretouchError."""
    free = _free() if command in READERS else 0
    if not free:
        yield
        return
    most = _taken() + int(_SHARE * free)
    before = [(kind, resource.getrlimit(kind)) for kind in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)]
    try:
        for (kind, (_, hard)), bound in zip(before, (most, _FILE), strict=True):
            resource.setrlimit(kind, (bound if hard == resource.RLIM_INFINITY else min(bound, hard), hard))
        yield
    except MemoryError:
        raise PretouchError(
            f"Reading takes more than {_SHARE * free / 2**30:.1f} GiB, half of what is free here: the file is"
            " damaged, or cut it into parts."
        ) from None
    finally:
        for kind, limits in before:
            resource.setrlimit(kind, limits)


def _free() -> int:
    """Memory that programs may take without swapping [bytes]; 0 where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")), 0)


def _taken() -> int:
    """Address space of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
