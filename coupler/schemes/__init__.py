"""One window: who goes first, what each half sees of the other, and how an iterated one comes to agreement."""
