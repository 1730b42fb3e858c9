"""The real program to one of integers: statements, expressions, and the digits that are carried on."""
