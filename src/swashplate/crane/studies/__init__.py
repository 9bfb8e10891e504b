"""Studies of a crane: many runs or a spectrum, and the assessment that follows from them."""
