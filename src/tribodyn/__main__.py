"""`python -m tribodyn` and the program `tribodyn`: the command."""

import gc
import sys


def main() -> None:
    """Run the command; Ctrl-C while it is still being loaded ends it as quietly as later."""
    gc.disable()  # of what is imported nothing is garbage, and looking for it takes a fifth of that time
    try:
        from tribodyn.workflows.command.main import main as command
    except KeyboardInterrupt:
        print("tribodyn: stopped.", file=sys.stderr)
        sys.exit(130)
    command()


if __name__ == "__main__":
    main()
