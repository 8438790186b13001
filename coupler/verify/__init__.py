"""Checks a half against the interface specification (docs/design.md): `slideline verify-half`."""
