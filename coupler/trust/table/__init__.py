"""The trust table: every check is asked in every window, and makes its row at the end."""
