"""Whether a run can be trusted: what can be wrong is measured in every window and told with its number."""
