"""Computation of the rows, a module for each subject."""
