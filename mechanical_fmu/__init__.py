"""The mechanical halves: `elastic` (finite elements) and `rigid` (prescribed motion), behind FMI."""
