"""Exit codes of the command line (README)."""

FAILED, BAD_INPUT, BAD_RESULTS, UNTRUSTED, DIFFER, INTERRUPTED = 1, 2, 3, 4, 5, 130
