"""The one declaration of a scene's physics: what a scenario states of it, what a half is told, and what is checked."""
