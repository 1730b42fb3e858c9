"""Covariance kept as the upper triangle of P."""
