# SPDX-License-Identifier: MIT
"""How many lying sensors a model survives, method by method, and what that costs."""
