"""From window to window: how long the next is, by which scheme, whether it stands, and what is remembered of it."""
