"""Covariance kept as U D U^T."""
