# SPDX-License-Identifier: MIT
"""Logs in other formats than Bulwark's CSV: candump, LCM, MCAP."""
