"""Banks of filters: the interacting multiple model."""
