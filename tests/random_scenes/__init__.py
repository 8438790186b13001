"""Scenes nobody wrote, and the laws that hold in all of them."""
