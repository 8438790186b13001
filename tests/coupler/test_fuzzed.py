"""Damaged messages from somebody who has the secret of the run: refused in words, at once, and nothing else changes."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from fuzzed import fuzz  # noqa: E402


def test_no_damaged_message_is_more_than_refused():
    found, bugs = fuzz(3000, seed=7)
    assert bugs == []
    for counts in found.values():
        assert set(counts) == {"unreadable", "refused", "answered"}
        assert min(counts.values()) > 100
