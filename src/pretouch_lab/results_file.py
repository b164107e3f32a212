"""What is said where results could not be written."""

from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from pretouch.errors import ExperimentError


@contextmanager
def failure_said(out: Path) -> Iterator[None]:
    """Turn a worker that was killed, or results that could not be written, into an ExperimentError."""
    try:
        yield
    except BrokenProcessPool as error:
        raise ExperimentError(
            "A worker process was killed, for want of memory perhaps: the same command with the same --out goes on."
        ) from error
    except OSError as error:
        raise ExperimentError(
            f"Results could not be written to {out} ({error.strerror or error}): remove the cause, and the same command"
            " with the same --out goes on."
        ) from error
