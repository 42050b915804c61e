# SPDX-License-Identifier: MIT
"""Analysis against brute force: sparse observability, security ratios, advice."""

import itertools

import golden
import numpy as np
import pytest

from blw import canonical, kalman, model, modes
from blw.analysis import advice, security
from blw.analysis.l1_ratio import RatioProblem
from blw.analysis.observability import Index, sparse_index
from blw.errors import DesignError
from blw.local_filters import local_filters

EIGENVALUES = (0.5, -0.8, 1.2)


def quiet(text):
    """No progress."""


def random_system(generator):
    """Small A with few distinct eigenvalues, often derogatory or defective, and a sparse C."""
    n, m = int(generator.integers(1, 5)), int(generator.integers(1, 6))
    J = np.diag(generator.choice(EIGENVALUES, n))
    for i in range(n - 1):
        if J[i, i] == J[i + 1, i + 1] and generator.random() < 0.5:
            J[i, i + 1] = 1.0
    if n > 1 and generator.random() < 0.3:
        J[:2, :2] = [[0.6, 0.7], [-0.7, 0.6]]
    T = np.linalg.qr(generator.standard_normal((n, n)))[0] * generator.uniform(0.5, 2.0, n)
    C = generator.integers(-1, 2, (m, n)) * (generator.random((m, n)) < 0.7)
    return T @ J @ np.linalg.inv(T), C @ np.linalg.inv(T)


def observable(A, C):
    rows = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(len(A))])
    return np.linalg.matrix_rank(rows, tol=1e-8) == len(A) if rows.size else False


def index_by_trying(A, C, units, protected=()):
    """Largest s for which every loss of s units leaves (A, C) observable."""
    open_units = [unit for unit in units if not set(unit) <= set(protected)]
    for s in range(len(open_units) + 1):
        for lost in itertools.combinations(open_units, s):
            gone = {i for unit in lost for i in unit} - set(protected)
            if not observable(A, C[[i for i in range(len(C)) if i not in gone]]):
                return s - 1
    return len(open_units)


@pytest.mark.parametrize("seed", range(5))
def test_index_given_random_systems_is_what_trying_all_losses_finds(seed):
    generator = np.random.default_rng(seed)
    for _ in range(80):
        A, C = random_system(generator)
        m = len(C)
        cut = int(generator.integers(0, m + 1))
        units = [list(range(cut))] * (cut > 0) + [[i] for i in range(cut, m)]
        protected = [i for i in range(m) if generator.random() < 0.2]
        seen = modes.modes_of(A, C).modes
        for groups in ([[i] for i in range(m)], units):
            for kept in ((), protected):
                found = sparse_index(seen, groups, kept)
                assert found.exact
                assert found.lower == index_by_trying(A, C, groups, kept), (A, C, groups, kept)


def test_index_given_chain_counts_sensors_of_its_eigenvector():
    A = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    C = np.array([[1.0, 0, 0]] * 2 + [[0, 1.0, 0]] * 5)
    index = sparse_index(modes.modes_of(A, C).modes, [[i] for i in range(7)])
    assert index == Index(1, 1, index.weakest)
    assert abs(index.weakest - 1.0) < 1e-9
    assert index.max_attacked == 0


def test_index_given_many_sensors_of_one_eigenspace_searches_its_hyperplanes():
    generator = np.random.default_rng(1)
    C = generator.standard_normal((20, 3))
    C[:9, 2] = 0.0
    index = sparse_index(modes.modes_of(np.eye(3), C).modes, [[i] for i in range(20)])
    assert index == Index(10, 10, 1.0)


def test_index_given_too_small_a_limit_is_a_bound():
    generator = np.random.default_rng(2)
    C = generator.standard_normal((30, 5))
    modes_found = modes.modes_of(np.eye(5), C).modes
    short = sparse_index(modes_found, [[i] for i in range(30)], limit=50)
    assert not short.exact
    assert short.lower < 25 and short.upper >= 25


def test_index_given_twenty_states_and_forty_sensors_takes_no_search():
    generator = np.random.default_rng(3)
    A, C = generator.standard_normal((20, 20)) / 4, generator.standard_normal((40, 20))
    index = sparse_index(modes.modes_of(A, C).modes, [[i] for i in range(40)], limit=0)
    assert index.exact and index.lower == 39


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_visibility_does_not_depend_on_units(scale):
    A, C = np.diag([0.9, 0.8, 1.1]), np.array([[1.0, 1e-3, 0.0], [0.0, 1.0, 1e-4]])
    D = np.diag([scale, 1.0, 1.0 / scale])
    found = modes.modes_of(D @ A @ np.linalg.inv(D), C @ np.linalg.inv(D))
    assert [mode.seen.tolist() for mode in found.modes] == [[True, True], [True, False],
                                                            [False, True]]


def ratio_by_vertices(inside, outside):
    """max |inside v|_1 / |outside v|_1: attained where n - 1 rows of the denominator vanish."""
    n, best = inside.shape[1], 0.0
    for rows in itertools.combinations(outside, n - 1):
        *_, V = np.linalg.svd(np.array(rows).reshape(n - 1, n))
        below = np.abs(outside @ V[-1]).sum()
        above = np.abs(inside @ V[-1]).sum()
        best = max(best, above / below if below > 1e-12 else np.inf)
    return best


def test_ratio_given_random_rows_is_that_of_the_best_vertex():
    generator = np.random.default_rng(4)
    for _ in range(60):
        n = int(generator.integers(1, 4))
        inside = generator.standard_normal((int(generator.integers(1, 4)), n))
        outside = generator.standard_normal((n + int(generator.integers(0, 3)), n))
        outside *= 10.0 ** generator.uniform(-3, 3, n)
        problem = RatioProblem(list(inside[:, None, :]), list(outside[:, None, :]))
        found, expected = problem.solve(64), ratio_by_vertices(inside, outside)
        assert found.exact
        assert found.lower == pytest.approx(expected, rel=1e-7)
        bounds = problem.solve(0)
        assert bounds.lower <= expected * (1 + 1e-7) and expected <= bounds.upper * (1 + 1e-7)


def test_ratio_given_pairs_is_within_its_bounds():
    generator = np.random.default_rng(5)
    angles = np.linspace(0.0, np.pi, 4001)
    directions = np.stack([np.cos(angles), np.sin(angles)])
    for _ in range(25):
        inside = [generator.standard_normal((2, 2)), generator.standard_normal((1, 2))]
        outside = [generator.standard_normal((size, 2)) for size in (2, 1, 2)]
        above, below = (sum(np.linalg.norm(rows @ directions, axis=0) for rows in part)
                        for part in (inside, outside))
        expected = np.max(above / below)
        found = RatioProblem(inside, outside).solve(64)
        assert found.lower <= expected * (1 + 1e-3)  # the grid is coarse
        assert expected <= found.upper * (1 + 1e-6)
        assert found.upper < 1.1 * found.lower
        assert found.lower > 0.98 * expected


def test_ratio_given_blind_rest_is_unbounded():
    problem = RatioProblem([np.array([[1.0, 0.0]])], [np.array([[0.0, 1.0]])])
    assert problem.solve(10).lower == np.inf


def case_of(loaded):
    gains = kalman.steady_state(loaded.A, loaded.C, loaded.W, loaded.R)
    found = modes.modes_of(loaded.A, loaded.C)
    return security.Case(loaded, gains, found, sparse_index(found.modes, loaded.units))


def shipped(name):
    return case_of(model.load(golden.MODELS / f"{name}.toml"))


@pytest.mark.parametrize(("name", "expected"), [
    ("liu5", [0.431, 1.687, 1.146, 0.758, 0.438]),
    ("pendulum", [0.5, 0.5, 0.5, 52.7]),
])
def test_lasso_given_the_papers_examples_is_not_secure(name, expected):
    verdict = security.verdicts(shipped(name), ["lasso"])["lasso"]
    assert not verdict.secure
    assert [ratio.lower for ratio in verdict.ratio] == pytest.approx(expected, rel=1.2e-3)
    assert all(ratio.exact for ratio in verdict.ratio)


def test_lasso_given_two_attacked_takes_the_worst_set():
    loaded = shipped("liu5").model
    two = model.parse({"name": "liu5", "dt_s": 1.0, "attack": {"p": 2}, "plant": {
        key: getattr(loaded, key).tolist() for key in ("A", "C", "Q", "R")}}, "liu5")
    case = case_of(two)
    found = security.verdicts(case, ["lasso"])["lasso"].ratio
    filters = local_filters(two, case.kalman)
    rows = filters.G.reshape(5, 3, 3)
    for i in range(5):
        expected = max(
            ratio_by_vertices(np.vstack(rows[list(pair)]),
                              np.vstack(rows[[j for j in range(5) if j not in pair]]))
            for pair in itertools.combinations(range(5), 2) if i in pair)
        assert found[i].lower == pytest.approx(expected, rel=1e-7)


def test_canonical_ratios_are_the_worst_over_all_sets():
    generator = np.random.default_rng(6)
    for _ in range(60):
        m, n = int(generator.integers(2, 6)), int(generator.integers(1, 4))
        p = int(generator.integers(1, m))
        observed = generator.random((m, n)) < 0.8
        weights = generator.uniform(1.0, 1.3, m)
        found = security.mode_ratios(observed, weights, [[i] for i in range(m)], p)
        for i in range(m):
            worst = 0.0
            for chosen in itertools.combinations(range(m), p):
                inside = np.isin(np.arange(m), chosen)
                above = weights[inside] @ observed[inside]
                below = weights[~inside] @ observed[~inside]
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.where(above > 0, above / below, 0.0).max()
                worst = max(worst, ratio if i in chosen else 0.0)
            assert found[i].lower == pytest.approx(worst, rel=1e-9)


def test_canonical_is_secure_exactly_if_2p_sparse_observable():
    generator = np.random.default_rng(7)
    judged = 0
    while judged < 40:
        A, C = random_system(generator)
        p = int(generator.integers(1, 3))
        found = modes.modes_of(A, C)
        index = sparse_index(found.modes, [[i] for i in range(len(C))])
        try:
            observed = found.observed
        except DesignError:
            continue
        weights = 1.0 + 0.05 * np.arange(len(C)) / p
        ratios = security.mode_ratios(observed, weights, [[i] for i in range(len(C))], p)
        secure = len(C) > p and all(ratio.secure for ratio in ratios)
        assert secure == (index.lower >= 2 * p) or (index.lower < 0)
        judged += 1


def test_verdicts_given_no_attack_need_no_defence():
    loaded = model.parse({"name": "calm", "dt_s": 1.0, "attack": {"p": 0}, "plant": {
        "A": [[0.9]], "C": [[1.0], [1.0]], "Q": [1.0], "R": [1.0, 1.0]}}, "calm")
    found = security.verdicts(case_of(loaded), ["kalman", "lasso", "canonical", "decentral"])
    assert all(verdict.secure for verdict in found.values())


def test_joint_needs_strong_sensors_that_see_what_lasts():
    def judged(strong):
        loaded = model.parse({"name": "two", "dt_s": 1.0, "attack": {"strong": strong}, "plant": {
            "A": [[1.0, 0.0], [0.0, 0.5]], "C": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
            "Q": [1.0, 1.0], "R": [1.0, 1.0, 1.0]}}, "two")
        return security.verdicts(case_of(loaded), ["joint"])["joint"].secure

    assert not judged([])
    assert judged(["y1"])
    assert not judged(["y2"])


def test_advice_given_two_sensors_wants_a_third_or_protection():
    loaded = model.parse({"name": "pair", "dt_s": 1.0, "attack": {"p": 1}, "plant": {
        "A": [[1.0, 0.1], [0.0, 1.0]], "C": [[1.0, 0.0], [1.0, 0.0]],
        "Q": [1.0, 1.0], "R": [1.0, 1.0]}}, "pair")
    found = advice.advise(loaded, modes.modes_of(loaded.A, loaded.C), quiet)
    assert found == [advice.Change("add", 1, [["another y1"]]),
                     advice.Change("protect", 1, [["y1"], ["y2"]])]
    assert found[0].text() == "add 1 sensor: another y1"


def test_advice_given_random_systems_is_enough_and_smallest():
    generator = np.random.default_rng(8)
    advised = 0
    while advised < 15:
        A, C = random_system(generator)
        if not observable(A, C) or len(C) < 2:
            continue
        loaded, _ = golden.build("advice", {"A": A, "Bu": np.zeros((len(A), 1)), "C": C,
                                            "Q": np.eye(len(A)), "R": np.eye(len(C))})
        found = modes.modes_of(A, C)
        if sparse_index(found.modes, loaded.units).lower >= 2:
            continue
        advised += 1
        changes = {change.kind: change for change in advice.advise(loaded, found, quiet)}
        units = [[i] for i in range(len(C))]
        for choice in changes["protect"].choices:
            kept = [loaded.sensors.index(name) for name in choice]
            assert index_by_trying(A, C, units, kept) >= min(2, len(C) - len(kept))
        assert not any(
            index_by_trying(A, C, units, kept) >= min(2, len(C) - len(kept))
            for size in range(changes["protect"].count)
            for kept in itertools.combinations(range(len(C)), size))


def test_groups_fall_together():
    plant = {"A": [[1.0]], "C": [[1.0]] * 4, "Q": [1.0], "R": [1.0] * 4}
    loaded = model.parse({"name": "can", "dt_s": 1.0, "plant": plant,
                          "attack": {"p": 1, "groups": [["y1", "y2"]]}}, "can")
    case = case_of(loaded)
    assert case.index.lower == 2
    found = security.verdicts(case, ["canonical"])["canonical"]
    weights = canonical.default_weights(loaded)
    pair = weights[:2].sum() / weights[2:].sum()
    assert [ratio.lower for ratio in found.ratio[:2]] == pytest.approx([pair, pair])
    assert found.secure == (pair < 1.0)
