"""Errors in time: of windows and their sum over a run, of the exchange, of instants between windows."""
