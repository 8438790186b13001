"""The command line: `slideline`."""
