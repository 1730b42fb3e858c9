"""What the code of any filter is set in: guards, loops over alike numbers, shared private functions."""
