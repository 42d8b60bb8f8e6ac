"""The figures: of a run, a fit, several runs and the bench, in one style."""
