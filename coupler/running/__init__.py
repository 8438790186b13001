"""A run as its user holds it: set up, stepped, watched, interrupted and resumed."""
