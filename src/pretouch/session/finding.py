"""What is found before an arm is moved, as sentences: what is wrong, the value, and the way out."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing to know before the arm moves."""

    what: str
    """A word for programs, as `rest` or `bias`."""
    sentence: str
    refused: bool = True
    """Whether the arm is not to be moved as long as it is so."""


def refusals(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of those that forbid a run."""
    return tuple(finding.sentence for finding in findings if finding.refused)
