"""``python -m swashplate``: the command line."""

from swashplate.cli import main

if __name__ == "__main__":
    main()
