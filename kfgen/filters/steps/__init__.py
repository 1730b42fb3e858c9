"""What a step of any filter is made of."""
