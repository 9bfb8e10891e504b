"""``swashplate`` and ``python -m swashplate``: the command line."""

from swashplate.stopping import obeying


def main() -> None:
    """Run the command line, which obeys Ctrl-C from here on, while it is imported too."""
    with obeying():
        from swashplate import cli

        cli.main()


if __name__ == "__main__":
    main()
