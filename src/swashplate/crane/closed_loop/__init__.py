"""One run of a crane: operator, control, three drives and the load in a loop, sample by sample."""
