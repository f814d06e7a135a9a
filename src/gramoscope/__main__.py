"""`python -m gramoscope`: the same as the command `gramoscope`."""

import sys

from gramoscope.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
