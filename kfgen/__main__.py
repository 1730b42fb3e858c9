"""`python -m kfgen` is the command `kfgen`."""

from kfgen.cli import main

if __name__ == "__main__":
    main()
