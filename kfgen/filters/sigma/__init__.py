"""The filters of sigma points."""
