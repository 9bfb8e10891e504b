"""What a fit is to find, of which model, from which runs, and the solver that finds it."""
