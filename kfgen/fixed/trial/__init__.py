"""The integers tried beside the real numbers: whether they follow, and what is known of overflow."""
