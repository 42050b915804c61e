# SPDX-License-Identifier: MIT
"""`report`: reading, figures by hand, plots and page."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.axes import Axes
from matplotlib.text import Text
from PIL import Image
from report_case import HEAD, SENSORS, STATES, Folder

from blw import cli
from blw.errors import BulwarkError
from blw.report import page, style, text, units
from blw.report.command import report
from blw.report.data import METHODS, Recording, Track, load
from blw.report.figures import collect
from blw.report.panels import PANELS, Panel
from blw.report.series import envelope, running_rms, runs


def test_envelope_given_a_spike_keeps_it():
    values = np.zeros(40_000)
    values[12_345] = 7.0
    t, thin = envelope(np.arange(40_000.0), values, 400)
    assert len(t) == len(thin) == 800
    assert thin.max() == 7.0
    assert abs(t[thin.argmax()] - 12_345) <= 100


def test_envelope_given_a_long_gap_keeps_it():
    values = np.ones(10_000)
    values[2_000:5_000] = np.nan
    t, thin = envelope(np.arange(10_000.0), values, 100)
    assert np.isnan(thin[(t > 2_200) & (t < 4_800)]).all()
    assert np.isfinite(thin[(t < 1_900) | (t > 5_100)]).all()


def test_envelope_given_a_short_series_leaves_it():
    t, values = np.arange(5.0), np.array([1.0, np.nan, 3.0, 2.0, 0.0])
    assert envelope(t, values, 400)[1] is values


def test_running_rms_given_a_gap_uses_what_is_there():
    values = np.array([3.0, 4.0, np.nan, 12.0, np.nan, np.nan])
    expected = [3.0, np.sqrt(12.5), 4.0, 12.0, 12.0, np.nan]
    np.testing.assert_allclose(running_rms(values, 2), expected)


def test_runs_given_small_gaps_bridges_them():
    flags = np.array([0, 1, 1, 0, 1, 0, 0, 1], dtype=bool)
    assert runs(flags) == [(1, 3), (4, 5), (7, 8)]
    assert runs(flags, bridge=1) == [(1, 5), (7, 8)]


@pytest.mark.parametrize(("name", "label"), [
    ("angle_rad_s", "angle (rad/s)"), ("a_m_s2", "a (m/s²)"), ("cart_m", "cart (m)"), ("x1", "x1"),
])
def test_label_given_a_suffix_states_the_unit(name: str, label: str):
    assert units.label(name) == label


@pytest.mark.parametrize(("value", "expected"), [
    (0.0, "0"), (1234.56, "1235"), (-0.012345, "−0.0123"), (5.4e-7, "5.40·10⁻⁷"),
    (1.2e8, "1.20·10⁸"),
])
def test_short_given_a_number_rounds_it(value: float, expected: str):
    assert text.short(value) == expected


def test_load_given_a_run_aligns_everything(folder: Folder):
    recording = load(folder.write())
    assert list(recording.tracks) == ["oracle", "kalman", "guard"]
    assert (recording.states, recording.sensors, recording.inputs) == (STATES, SENSORS, ["u1"])
    assert recording.episodes == [(4, 7)]
    assert recording.targets == [["y2"]]
    assert recording.tracks["guard"].status[0] == ""
    assert np.isnan(recording.y[9, 2])
    assert recording.tracks["guard"].excluded[6].tolist() == [True, True, False]


def test_load_given_columns_in_another_order_reads_the_same(folder: Folder):
    straight = load(folder.write())
    folder.tables["log"] = [row[::-1] for row in folder.tables["log"]]
    turned = load(folder.write())
    np.testing.assert_array_equal(turned.y, straight.y)
    np.testing.assert_array_equal(turned.x, straight.x)


def test_load_given_a_window_without_signal_counts_all_of_it(folder: Folder):
    folder.summary["attack_windows"] = [{"from_k": 3, "to_k": 8, "sensors": ["y2", "y3"]}]
    recording = load(folder.write())
    assert recording.episodes == [(3, 8)]
    assert runs(recording.attacked[:, 1]) == [(4, 7)]
    assert runs(recording.attacked[:, 2]) == [(3, 8)]


def test_collect_given_a_run_agrees_with_the_hand(folder: Folder):
    figures = collect(load(folder.write()))
    kalman, guard = figures["kalman"], figures["guard"]
    assert kalman["mse"] == {"before": 1.0, "during": 25.0, "after": 1.0, "all": 8.2}
    assert kalman["rmse"]["during"] == 5.0
    assert kalman["rmse_state"]["during"] == [3.0, 4.0]
    assert kalman["ratio_to_oracle"] == {"before": 1.0, "during": 25.0, "after": 1.0, "all": 8.2}
    assert kalman["false_alarm_rate"] is None
    assert guard["detection_delay_steps"] == 1.0
    assert guard["attacks_detected"] == {"count": 1, "of": 1, "rate": 1.0}
    assert guard["false_alarm_rate"] == pytest.approx(1 / 7)
    assert guard["false_alarm_rate_before"] == pytest.approx(1 / 3)
    assert guard["missed_exclusions"] == {"count": 1, "of": 3, "rate": pytest.approx(1 / 3)}
    assert guard["wrong_exclusions"] == {"count": 1, "of": 26, "rate": pytest.approx(1 / 26)}
    assert guard["iterations"] == {"mean": pytest.approx(0.9), "max": 3}
    assert guard["kalman_rate"]["all"] == pytest.approx(0.7)


def test_collect_given_a_summary_prefers_it(folder: Folder):
    folder.summary |= {"runs": 50, "methods": {"guard": {"mse": dict.fromkeys(
        ("before", "during", "after", "all"), 0.25)}}}
    recording = load(folder.write())
    assert collect(recording)["guard"]["mse"]["all"] == 0.25
    assert any("50 runs" in sentence for sentence in text.caveats(recording))


def test_collect_given_no_truth_reads_errors_against_the_oracle(tmp_path: Path):
    recording = load(Folder(tmp_path / "run", truth=False).write())
    figures = collect(recording)
    assert recording.yardstick == "oracle"
    assert figures["kalman"]["mse"]["during"] == 18.0
    assert figures["oracle"]["mse"] is None
    assert figures["kalman"]["ratio_to_oracle"] is None
    assert any("no true states" in sentence for sentence in text.caveats(recording))


SPOILED = {
    "no log": (lambda f: f.tables.pop("log"), "log.csv: no such file"),
    "no methods": (lambda f: [f.tables.pop(n) for n in ("oracle", "kalman", "guard")],
                   "no method's output"),
    "only a header": (lambda f: f.tables["log"].__delitem__(slice(1, None)), "log.csv: a header"),
    "ragged row": (lambda f: f.tables["kalman"][3].pop(), "kalman.csv:4: 12 cells"),
    "word in a number": (lambda f: f.tables["guard"][5].__setitem__(3, "abc"),
                         "guard.csv:6: column 'angle_rad': 'abc' is not a number"),
    "steps go back": (lambda f: f.tables["log"][4].__setitem__(0, 1), "log.csv:5: column 'k'"),
    "broken step": (lambda f: f.tables["log"][4].__setitem__(0, "1.5"),
                    "log.csv:5: column 'k': '1.5' is not an integer"),
    "no time": (lambda f: f.tables["log"][4].__setitem__(1, ""), "log.csv:5: column 't_s'"),
    "time goes back": (lambda f: f.tables["log"][4].__setitem__(1, 0), "log.csv:5: column 't_s'"),
    "no such sensor": (lambda f: f.tables["guard"][5].__setitem__(9, "y9"),
                       "guard.csv:6: 'y9' is no sensor"),
    "bad header": (lambda f: f.tables["kalman"].__setitem__(0, ["k", *HEAD[2:], "z"]),
                   "kalman.csv:1: the header"),
    "other sensors": (lambda f: f.tables["kalman"].__setitem__(0, [*HEAD[:-1], "suspicion:z"]),
                      "kalman.csv:1: states and sensors differ"),
    "unknown step": (lambda f: f.tables["kalman"][10].__setitem__(0, 99),
                     "kalman.csv:11: step 99 is not in log.csv"),
    "sensor not logged": (lambda f: f.tables["log"][0].__setitem__(2, "z"),
                          "log.csv:1: no column 'y1'"),
    "summary is a list": (lambda f: setattr(f, "summary", []), "summary.json: an object"),
    "window not logged": (lambda f: f.summary.update(attack_windows=[{"from_k": 99}]),
                          "summary.json: attack_windows"),
}


@pytest.mark.parametrize("case", SPOILED)
def test_report_given_bad_input_says_where_and_writes_nothing(
        folder: Folder, case: str, capsys: pytest.CaptureFixture):
    spoil, message = SPOILED[case]
    spoil(folder)
    before = sorted(folder.write().iterdir())
    assert cli.main(["report", str(folder.path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert sorted(folder.path.iterdir()) == before


@pytest.mark.parametrize(("name", "content", "message"), [
    ("summary.json", b"{", "summary.json: "),
    ("log.csv", b"k,t_s\n\xff\xfe,0\n", "log.csv: "),
])
def test_load_given_undecodable_bytes_names_the_file(
        folder: Folder, name: str, content: bytes, message: str):
    (folder.write() / name).write_bytes(content)
    with pytest.raises(BulwarkError, match=re.escape(message)):
        load(folder.path)


def test_report_given_no_folder_is_refused(tmp_path: Path):
    assert cli.main(["report", str(tmp_path / "nowhere")]) == 2


class Links(HTMLParser):
    """Everything a page loads, and its images' texts."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.alts: list[str] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.targets += [given[k] or "" for k in ("src", "srcset", "href") if k in given]
        self.alts += [given.get("alt") or ""] if tag == "img" else []
        self.ids |= {given["id"] or ""} if "id" in given else set()


def test_report_given_a_run_writes_a_self_contained_page(folder: Folder):
    result = CliRunner().invoke(report, [str(folder.write()), "--json"])
    assert result.exit_code == 0, result.output
    html = (folder.path / "report.html").read_text(encoding="utf-8")
    links = Links()
    links.feed(html)
    inside = [t for t in links.targets if t.startswith("#")]
    assert all(t.startswith(("#", "data:")) for t in links.targets)
    assert all(t[1:] in links.ids for t in inside)
    assert "url(" not in html and "<script" not in html and "@import" not in html
    drawn = [p.key for p in PANELS if p.applies(load(folder.path))]
    assert len(links.alts) == len(drawn) and all(len(alt) > 20 for alt in links.alts)
    assert {p.stem for p in folder.path.glob("*.png")} == set(drawn)
    assert not list(folder.path.glob(".report-*"))
    figures = json.loads(result.output)
    assert figures["methods"]["kalman"]["mse"]["during"] == 25.0
    assert ">8.2<" in html and ">25<" in html and "y2 from 0.4 s to 0.6 s" in html


def test_write_given_a_panel_that_no_longer_applies_removes_its_plot(
        folder: Folder, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page, "PANELS", [p for p in PANELS if p.key in ("excluded", "states")])
    page.write(load(folder.write()))
    assert (folder.path / "excluded.png").exists()
    first = (folder.path / "states.png").read_bytes()
    for row in folder.tables["guard"][1:]:
        row[9] = ""
    page.write(load(folder.write()))
    assert not (folder.path / "excluded.png").exists()
    assert (folder.path / "states.png").read_bytes() == first


def test_write_given_a_panel_that_fails_leaves_the_folder_as_it_was(
        folder: Folder, monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise ZeroDivisionError

    good = next(p for p in PANELS if p.key == "states")
    monkeypatch.setattr(page, "PANELS", [good, Panel("bad", "Bad", lambda r: True, fail)])
    before = sorted(folder.write().iterdir())
    with pytest.raises(ZeroDivisionError):
        page.write(load(folder.path))
    assert sorted(folder.path.iterdir()) == before


def large(steps: int, n: int, m: int) -> Recording:
    """Every method on a plant of n states and m sensors with long names."""
    rng = np.random.default_rng(3)
    states = [f"wing_bending_{j}_rad_s" for j in range(n)]
    sensors = [f"accelerometer_{i}" for i in range(m)]
    x, attack = rng.normal(size=(steps, n)).cumsum(axis=0), np.zeros((steps, m))
    attack[steps // 3 : steps // 2, [1, m - 1]] = 1e3

    def track(name: str) -> Track:
        test = name not in ("oracle", "kalman")
        statistic = rng.chisquare(5, steps) * (1 + 99 * (attack[:, 1] > 0))
        return Track(
            name, np.where(statistic > 20, "bound", "kalman"), x + rng.normal(size=(steps, n)),
            statistic, np.full(steps, 20.0 * test), rng.integers(0, 30, steps) * float(test),
            np.zeros(steps), (attack > 0) & test, rng.uniform(size=(steps, m)),
            {prefix + sensors[0]: rng.uniform(size=steps) for prefix in ("theta:", "theta_sd:")})

    k = np.arange(steps)
    return Recording(
        Path("."), k, k * 0.01, states, sensors, ["elevator_N"], rng.normal(size=(steps, m)),
        rng.normal(size=(steps, 1)), x, attack, {name: track(name) for name in METHODS}, {}, [])


def labels(ax: Axes) -> list[Text]:
    """Titles, the label of the time axis, and those of the ticks in view."""
    low, high = sorted(ax.get_ylim())
    ticks = zip(ax.get_yticks(), ax.get_yticklabels())
    return [ax.title, ax._right_title, ax.xaxis.label, *(t for y, t in ticks if low <= y <= high)]


@pytest.fixture(scope="module")
def crowd() -> Recording:
    return large(steps=3000, n=12, m=16)


@pytest.mark.parametrize("layout", [style.WIDE, style.NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel.key)
def test_draw_given_a_crowd_keeps_all_text_inside(
        panel: Panel, layout: style.Layout, crowd: Recording):
    with mpl.rc_context(style.RC):
        figure = panel.draw(crowd, layout).figure
        figure.draw_without_rendering()
        boxes = {t.get_text(): t.get_window_extent()
                 for ax in figure.axes for t in labels(ax) if t.get_text()}
        boxes.update(("legend", legend.get_window_extent()) for legend in figure.legends)
    wide, high = figure.get_size_inches() * figure.dpi
    assert [name for name, b in boxes.items()
            if b.x0 < -1 or b.y0 < -1 or b.x1 > wide + 1 or b.y1 > high + 1] == []


def test_draw_given_a_dollar_in_a_name_draws_it(crowd: Recording):
    odd = replace(crowd, sensors=[f"${i}$^" for i in range(16)])
    panel = next(p for p in PANELS if p.key == "sensors")
    with mpl.rc_context(style.RC):
        panel.draw(odd, style.WIDE).figure.draw_without_rendering()


def test_colour_given_all_methods_tells_them_apart():
    channels = np.array([[int(style.colour(m)[i : i + 2], 16) for i in (1, 3, 5)] for m in METHODS])
    distance = np.abs(channels[:, None] - channels[None]).sum(axis=2)
    assert distance[~np.eye(len(METHODS), dtype=bool)].min() > 60
    assert style.colour("an_unknown_method").startswith("#")


@pytest.mark.parametrize(("count", "columns"), [(1, 1), (2, 2), (3, 3), (4, 2), (7, 4), (9, 3),
                                                (16, 4)])
def test_columns_for_given_a_count_leaves_little_empty(count: int, columns: int):
    assert style.columns_for(count, 4) == columns
    assert style.columns_for(count, 1) == 1


def test_render_given_hostile_names_escapes_them(folder: Folder):
    folder.summary["name"] = "<script>alert(1)</script>"
    html = page.render(load(folder.write()), [])
    assert "<script" not in html
    assert "&lt;script&gt;" in html


def test_png_given_a_figure_is_opaque_and_of_the_stated_size(folder: Folder, tmp_path: Path):
    recording = load(folder.write())
    panel = next(p for p in PANELS if p.key == "overview")
    shown = page._show(panel, recording, tmp_path)
    with Image.open(tmp_path / "overview.png") as picture:
        assert picture.mode == "RGB"
        assert picture.size == shown.size
