"""Fixed point: numbers of 32 bits with a binary point wherever it serves."""
