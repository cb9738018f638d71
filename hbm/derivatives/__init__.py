"""Exact derivatives of the numbers of a solution by parameters: of cycles, peaks, folds and nonlinear modes."""
