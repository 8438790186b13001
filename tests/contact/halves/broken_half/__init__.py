"""A half of ours that is wrong in one way: a case of tests/coupler/broken_halves.py, as an FMU."""
