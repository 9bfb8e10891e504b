"""The drive's equations: one component a file, scalar functions of floats, compiled, no I/O."""
