"""How materials flow: one file a law, all of them named in catalogue.py."""
