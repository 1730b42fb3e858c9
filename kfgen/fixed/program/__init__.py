"""The real program as it is seen before it runs: where its numbers live, what is tied to what, loops written out."""
