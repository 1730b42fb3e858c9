"""A search for faults that takes hours: `python -m tests.campaign --help`; no part of `make test`."""
