"""Whether data and model are sound: checks, causes of errors, discrepancy, and the verdict."""
