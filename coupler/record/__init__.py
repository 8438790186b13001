"""What a run leaves: journal, checkpoints, results and field files, and how it goes on from them."""
