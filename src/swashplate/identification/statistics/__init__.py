"""How well the unknowns are known: intervals, profiles, identifiability, design of experiments."""
