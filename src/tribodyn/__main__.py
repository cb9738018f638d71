"""`python -m tribodyn`: the command."""

from tribodyn.workflows.command.main import main

if __name__ == "__main__":
    main()
