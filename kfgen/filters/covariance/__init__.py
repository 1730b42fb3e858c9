"""How a covariance is held, predicted and updated: U D U^T, full, triangular root; straight or in loops."""
