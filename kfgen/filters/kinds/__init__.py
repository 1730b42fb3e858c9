"""The filters that linearise, each as its book page; a module with a table FILTERS is all that a new one takes."""
