"""How large the integers may be."""

from __future__ import annotations

BITS = 30  # of the size of a number inside: sums of two then fit an int32_t
OUTSIDE = 31  # of one that the user reads or writes
INSIDE = (1 << BITS) - 1
"""What every number inside is clipped to: then a product of two by 2^-30, and a sum of two, fit."""
LIMIT = (1 << OUTSIDE) - 1
"""Results lie within -LIMIT and LIMIT, so that each has a negative; arguments may be LEAST too."""
LEAST = -(1 << OUTSIDE)
FINE = 26  # fraction bits that a probability has inside, as sums of them have
