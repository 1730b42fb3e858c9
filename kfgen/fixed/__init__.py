"""A filter in integers: ranges from runs, binary points from ranges, the real program lowered to an integer one."""
