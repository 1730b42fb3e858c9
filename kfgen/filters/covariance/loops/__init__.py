"""What the looped forms of the covariance have in common: local arrays, gains in them, columns absorbed."""
