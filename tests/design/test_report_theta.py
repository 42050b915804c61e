# SPDX-License-Identifier: MIT
"""`report`: what methods say was added to the sensors, and what their designs say of them."""

import numpy as np
from report_case import ATTACKED, HEAD, Folder

from blw.report import panels_theta, style, text
from blw.report.data import load
from blw.report.figures import collect
from blw.report.panels import PANELS


def add_joint(folder: Folder) -> Folder:
    """A method that estimates the attack on y2: half a unit too high, one too high under attack."""
    rows = [[*folder.row(k, 0, 1), 2.0 if k in ATTACKED else 0.5, 0.25] for k in range(1, 11)]
    folder.tables["joint"] = [[*HEAD, "theta:y2", "theta_sd:y2"], *rows]
    return folder


def test_estimates_given_columns_of_a_method_finds_signal_and_deviation(folder: Folder):
    found = panels_theta.estimates(load(add_joint(folder).write()))
    assert [(one.track.name, one.sensor) for one in found] == [("joint", "y2")]
    assert np.isnan(found[0].theta[0])
    np.testing.assert_array_equal(found[0].theta[[3, 5]], [0.5, 2.0])
    assert found[0].sd[5] == 0.25


def test_draw_given_attack_estimates_shows_signal_band_and_error(folder: Folder):
    recording = load(add_joint(folder).write())
    panel = next(p for p in PANELS if p.key == "attack_estimates")
    assert panel.applies(recording)
    (ax,) = panel.draw(recording, style.WIDE).figure.axes
    injected, estimate = (line.get_ydata() for line in ax.lines)
    np.testing.assert_array_equal(injected, recording.a[:, 1])
    np.testing.assert_array_equal(estimate[1:], [0.5] * 3 + [2.0] * 3 + [0.5] * 4)
    (band,) = ax.collections
    heights = band.get_paths()[0].vertices[:, 1]
    assert (heights.min(), heights.max()) == (0.0, 2.5)
    # ten steps: an error of 1 in three of them, of 0.5 in the others
    assert ax._right_title.get_text() == f"error {np.sqrt(0.475):.3g}, stated 0.25"


def test_draw_given_attack_estimates_of_an_unknown_attack_states_no_error(folder: Folder):
    add_joint(folder).tables["log"] = [row[:-3] for row in folder.tables["log"]]
    recording = load(folder.write())
    assert recording.a is None
    panel = next(p for p in PANELS if p.key == "attack_estimates")
    (ax,) = panel.draw(recording, style.WIDE).figure.axes
    assert len(ax.lines) == 1 and ax._right_title.get_text() == ""


def test_attack_estimates_given_no_method_that_has_any_do_not_apply(folder: Folder):
    panel = next(p for p in PANELS if p.key == "attack_estimates")
    assert not panel.applies(load(folder.write()))


def test_findings_given_a_verdict_of_the_design_tell_it(folder: Folder):
    folder.summary["methods"] = {"guard": {"verdict": "a plain filter does as well"}, "kalman": {}}
    recording = load(folder.write())
    told = [s for s in text.findings(recording, collect(recording)) if "design" in s]
    assert told == ["The design of guard says: a plain filter does as well."]
