"""``python -m vhquad``: the command line."""

import sys

if __name__ == "__main__":
    try:
        from vhquad.cli.app import main

        main()
    except KeyboardInterrupt:  # before `main` could take care of it
        sys.exit(130)
