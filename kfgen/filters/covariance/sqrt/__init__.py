"""Covariance kept as its lower Cholesky factor."""
