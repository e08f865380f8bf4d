"""`python -m ncgen.cli` is the command `ncgen`."""

from ncgen.cli import main

if __name__ == "__main__":
    main()
