"""Exit codes of the command line (README)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coupler.record.results import Results

FAILED, BAD_INPUT, BAD_RESULTS, UNTRUSTED, DIFFER, INTERRUPTED = 1, 2, 3, 4, 5, 130


def exit_code(results: Results) -> int:
    """Return the code of a run that was not finished, or is not to be trusted; 0 of all others."""
    if results.outcome == "interrupted":
        return INTERRUPTED
    # fault: a run that does not trust itself ends with 0 -> return 0 | coupler/test_trust
    return UNTRUSTED if results.broken else 0
