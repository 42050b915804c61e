# SPDX-License-Identifier: MIT
"""`tools/bulwark report`: a page and plots from what `run` or `replay` wrote into a folder."""
# Importing a module of panels registers them, in the order in which the page shows them.
from blw.report import panels_state  # noqa: F401, I001
from blw.report import panels_decision  # noqa: F401
from blw.report import panels_sensor  # noqa: F401
from blw.report import panels_theta  # noqa: F401
from blw.report import panels_signal  # noqa: F401
from blw.report.command import report

__all__ = ["report"]
