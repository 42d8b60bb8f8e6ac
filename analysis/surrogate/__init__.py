"""A fast stand-in for the solver, with bars."""
