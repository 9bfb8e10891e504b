"""Parameter sets: what a parameter is, the published values, rules and files."""
