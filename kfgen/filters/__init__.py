"""The filters: algorithms written as in the book, traced into programs."""
