"""Many runs of one scenario: studies of cost against error, and advice on the cheapest model that is enough."""
