"""The program: what a traced algorithm becomes before it is printed, run or counted."""
