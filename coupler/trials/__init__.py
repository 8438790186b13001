"""Trials: a scenario with values put in place of its own, run once for its probes and its cost, and kept."""
