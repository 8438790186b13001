"""Advice: how little of a scene's model its user needs, found by running the scene without this and without that."""
