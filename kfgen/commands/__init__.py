"""The commands of `kfgen`, one module each; what is slow to import is imported where it is used."""
