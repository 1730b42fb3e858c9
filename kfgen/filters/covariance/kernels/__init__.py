"""The private functions that the loops of all covariance forms call."""
