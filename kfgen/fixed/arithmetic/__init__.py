"""The integer arithmetic: what each C routine computes to the last bit, its tables, and q<m>.<n> as a scalar type."""
