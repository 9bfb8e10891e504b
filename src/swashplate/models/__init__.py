"""The machines: their equations, parameters and states, as values of the engine."""
