"""`python -m quell` is the command `quell`."""

import sys

from ._command import main

sys.exit(main())
