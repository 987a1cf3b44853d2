"""``python -m vhquad``: the command line."""

from vhquad.cli.app import main

if __name__ == "__main__":
    main()
