# SPDX-License-Identifier: MIT
"""`python -m blw`: the same as tools/bulwark, without its set-up."""

import sys

from blw.cli import main

sys.exit(main())
