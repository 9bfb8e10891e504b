"""The drive's simulation: from a parameter set and a record to signals, derivatives and batches."""
