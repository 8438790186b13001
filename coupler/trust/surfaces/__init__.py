"""What surfaces of bodies do to each other: passing, overlap, edges of curves, what windows skip on the way."""
