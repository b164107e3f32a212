"""`python -m pretouch.cli` is the command `pretouch`."""

import sys

from pretouch.cli import main

sys.exit(main())
