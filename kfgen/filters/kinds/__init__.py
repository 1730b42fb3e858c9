"""The filters that linearise: each reads as its book page. A module with a table FILTERS is all that a new one takes."""
