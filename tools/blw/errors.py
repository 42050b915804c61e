# SPDX-License-Identifier: MIT
"""What the tools refuse.  The message of every error says what is wrong and where."""


class BulwarkError(Exception):
    """Bad input or a failed step; the command line prints the message and exits with status 2."""


class ModelError(BulwarkError):
    """A model file that cannot be used: malformed, inconsistent or out of range."""


class DesignError(BulwarkError):
    """A sound model that a method, or every method, must refuse; states the reason and number."""
