"""Which values are met: the real program on floats, over logs of the user's and logs drawn from the model."""
