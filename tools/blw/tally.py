# SPDX-License-Identifier: MIT
"""Counts of test results."""

import xml.etree.ElementTree as xml
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Tally:
    """How many tests passed, failed and were skipped; prints as CI wants to read it."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    @classmethod
    def of(cls, ok: bool) -> "Tally":
        """One check that passed or failed."""
        return cls(passed=int(ok), failed=int(not ok))

    @classmethod
    def of_cases(cls, cases: Iterable[xml.Element]) -> "Tally":
        """The test cases of a JUnit file, as ctest and pytest write it."""
        tally = cls()
        for case in cases:
            if case.find("failure") is not None or case.find("error") is not None:
                tally += cls(failed=1)
            elif case.find("skipped") is not None:
                tally += cls(skipped=1)
            else:
                tally += cls(passed=1)
        return tally

    def __add__(self, other: "Tally") -> "Tally":
        return Tally(self.passed + other.passed, self.failed + other.failed,
                     self.skipped + other.skipped)

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"
