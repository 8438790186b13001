"""A half for tests: n nodes relax towards an input, with hidden state, discards, and bugs on demand."""
