"""Rules: data that say what a run is to do where it shows this or that."""
