# SPDX-License-Identifier: MIT
"""How `bulwark test` counts."""

import sys
import xml.etree.ElementTree as xml

import pytest

from blw.build import StepFailed
from blw.tally import Tally
from blw.testing import _report, _with_junit

JUNIT = """<testsuite>
  <testcase name="a"/>
  <testcase name="b" status="fail"><failure message="no"/></testcase>
  <testcase name="c"><error message="no"/></testcase>
  <testcase name="d"><skipped message="no data"/></testcase>
  <testcase name="e"><system-out>fine</system-out></testcase>
</testsuite>"""


def test_tally_given_junit_counts_its_cases():
    tally = Tally.of_cases(xml.fromstring(JUNIT).iter("testcase"))
    assert tally == Tally(passed=2, failed=2, skipped=1)
    assert str(tally) == "2 passed, 2 failed, 1 skipped"


def test_report_given_step_that_does_not_build_counts_a_failure(capsys):
    def step() -> Tally:
        raise StepFailed("preset host-f32: it does not build")
    assert _report("host-f32", step) == Tally(failed=1)
    assert "it does not build" in capsys.readouterr().err


@pytest.mark.parametrize("script, tally", [
    ("open(argv[2], 'w').write('<testsuite><testcase/></testsuite>')", Tally(passed=1)),
    ("open(argv[2], 'w').write('<testsuite><testcase/></testsuite>'); exit(3)",
     Tally(passed=1, failed=1)),
    ("exit(1)", Tally(failed=1)),
])
def test_runner_given_bad_status_without_failed_test_counts_a_failure(tmp_path, script, tally):
    command = [sys.executable, "-c", f"from sys import argv, exit; {script}"]
    assert _with_junit(command, tmp_path / "result.xml", "--junit") == tally
