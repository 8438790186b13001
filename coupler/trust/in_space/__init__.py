"""Errors in space: what cells are too large for, and what a scene's mesh does not hold."""
