# SPDX-License-Identifier: MIT
"""What an estimator costs on a microcontroller: instructions, flash, RAM and stack, measured."""
