"""A thermal half for tests, of a third party: with fields of its own that the coupler has never heard of."""
