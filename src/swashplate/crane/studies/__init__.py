"""Studies of a crane: many runs or a spectrum, and the judgment that follows from them."""
