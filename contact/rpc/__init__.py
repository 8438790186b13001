"""Calls that reach the contact service once: in this process, through the codec, or over zenoh."""
