"""A new scenario: from a template by questions or options, or from another program's deck."""
