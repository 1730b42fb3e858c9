"""Formulas that hold vectors, matrices and quaternions, and entries that declare them -> numbers, part by part."""
