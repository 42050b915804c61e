# SPDX-License-Identifier: MIT
"""How `bulwark test` counts."""

import sys
import xml.etree.ElementTree as xml
from functools import partial
from threading import Barrier

import pytest

from blw.build import StepFailed
from blw.tally import Tally
from blw.testing import ALONE, LANES, _report, _tallies, _with_junit

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


def test_steps_given_one_that_wants_to_be_alone_run_it_when_the_others_have_ended():
    running, most, seen = [], [], []
    meeting = Barrier(LANES, timeout=60)

    def step(name: str) -> Tally:
        running.append(name)
        if name not in ALONE:
            meeting.wait()  # so many run at the same time, or none gets past
        most.append(len(running))
        seen.append(name)
        running.remove(name)
        return Tally(passed=1)

    names = [*ALONE, *(f"step{i}" for i in range(2 * LANES))]
    tallies = list(_tallies({name: partial(step, name) for name in names}))
    assert sum(tallies, Tally()) == Tally(passed=len(names))
    assert sorted(seen) == sorted(names)
    assert seen[-len(ALONE):] == list(ALONE)
    assert most[-1] == 1


@pytest.mark.parametrize("script, tally", [
    ("open(argv[2], 'w').write('<testsuite><testcase/></testsuite>')", Tally(passed=1)),
    ("open(argv[2], 'w').write('<testsuite><testcase/></testsuite>'); exit(3)",
     Tally(passed=1, failed=1)),
    ("exit(1)", Tally(failed=1)),
])
def test_runner_given_bad_status_without_failed_test_counts_a_failure(tmp_path, script, tally):
    command = [sys.executable, "-c", f"from sys import argv, exit; {script}"]
    assert _with_junit(command, tmp_path / "result.xml", "--junit") == tally
