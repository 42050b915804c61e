# SPDX-License-Identifier: MIT
"""Bulwark's design tool: model files in; tables, C sources, analyses and reports out."""

__version__ = "0.1.0"
