"""Halves behind FMI: loading them, talking to them in this process or another, keeping them alive."""
