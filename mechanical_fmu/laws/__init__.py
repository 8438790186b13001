"""How materials flow: hardening, creep, melting; all laws are named in catalogue.py."""
