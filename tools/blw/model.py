# SPDX-License-Identifier: MIT
"""The model file: what it may say, and every check it must pass (README, "Model files").

    x(k+1) = A x(k) + Bu u(k) + B w(k),  w ~ N(0, Q)
    y(k)   = C x(k) + offset + v(k) + a(k),  v ~ N(0, R)
"""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from blw import names
from blw.errors import ModelError
from blw.options import check_keys
from blw.reader import Reader

METHOD_NAMES = ("kalman", "lasso", "canonical", "joint", "decentral", "bank", "guard")
MAX_SENSORS = 64
MAX_SIZE = 255
SYMMETRY = 1e-9
#: |A| dt up to which exp(-A dt) costs Q no more than three digits.
LOAN_SIZE = 4.0
#: A sensor that sends more rarely has to be modelled on slower steps.
MIN_RATE = 0.01
#: Samples that have to fail to come before a sensor counts as silent.
EXPECTED = 3

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Model:
    """A checked, discrete-time model.  Sizes: n states, m sensors, l inputs, s noise sources.

    sample_R is the covariance of single samples: R, except where R is that of gaps.py.
    """

    name: str
    dt_s: float
    n: int
    m: int
    l: int  # noqa: E741  the letter of the papers and of the C library
    p: int
    A: Array
    Bu: Array
    B: Array
    C: Array
    Q: Array
    R: Array
    x0: Array
    P0: Array | None
    offset: Array
    range: Array
    rate: Array
    sample_R: Array
    noise_margin: float
    states: list[str]
    sensors: list[str]
    inputs: list[str]
    strong: list[str] = field(default_factory=list)
    groups: list[list[str]] = field(default_factory=list)
    methods: dict[str, dict[str, Any]] = field(default_factory=dict)
    path: str = ""
    sha256: str = ""

    @property
    def W(self) -> Array:
        """[n, n] covariance of the process noise as the state sees it, B Q B'."""
        W = self.B @ self.Q @ self.B.T
        return (W + W.T) / 2

    @property
    def weight(self) -> Array:
        """[m] steps that one sample stands for, 1 / rate."""
        return 1.0 / self.rate

    @property
    def silence(self) -> int:
        """Steps in which EXPECTED samples of the sensor that sends least should have come."""
        return int(np.ceil(EXPECTED / self.rate.min()))

    @property
    def units(self) -> list[list[int]]:
        """Sensors that fall together, as indices: the groups, then every other sensor alone."""
        grouped = [[self.sensors.index(name) for name in group] for group in self.groups]
        taken = {i for group in grouped for i in group}
        return grouped + [[i] for i in range(self.m) if i not in taken]


def load(path: str | Path) -> Model:
    """Read a model file.  Raises ModelError saying what is wrong and where."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: {error.strerror}") from None
    try:
        mapping = tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{path}: {error}") from None
    except RecursionError:
        raise ModelError(f"{path}: lists nested too deeply") from None
    return _build(mapping, str(path), str(path), hashlib.sha256(data).hexdigest())


def parse(mapping: Mapping[str, Any], where: str) -> Model:
    """Check a model given as nested tables; where names it in messages.  Raises ModelError."""
    text = json.dumps(mapping, sort_keys=True, default=str)
    return _build(mapping, where, "", hashlib.sha256(text.encode()).hexdigest())


def _build(mapping: Mapping[str, Any], where: str, path: str, sha256: str) -> Model:
    top = Reader(mapping, f"{where}: ", ("name", "dt_s", "plant", "attack", "method"))
    name = names.check_model_name(top.require("name"), where)
    dt_s = top.positive("dt_s")
    plant = Reader(top.table("plant", required=True), f"{where}: plant.",
                   ("states", "sensors", "inputs", "A", "Bu", "B", "C", "Q", "R", "x0", "P0",
                    "offset", "range", "rate", "noise_margin", "continuous"))
    parts = _dynamics(plant, dt_s)
    parts |= _labels(plant, parts)
    parts |= _measurement(plant, parts)
    parts |= _attack(Reader(top.table("attack"), f"{where}: attack.", ("p", "strong", "groups")),
                     parts["sensors"])
    methods = _methods(top.table("method"), where)
    return Model(name=name, dt_s=dt_s, methods=methods, path=path, sha256=sha256, **parts)


def _dynamics(plant: Reader, dt_s: float) -> dict[str, Any]:
    """Sizes, A, Bu, B, C, Q, x0, P0; discretised if the file says continuous."""
    A = plant.matrix("A", None, None)
    n = len(A)
    if A.shape[1] != n:
        plant.fail("A", f"must be square, not {n} x {A.shape[1]}")
    Bu = plant.matrix("Bu", n, None, default=np.zeros((n, 0)))
    B = plant.matrix("B", n, None, default=np.eye(n))
    C = plant.matrix("C", None, n)
    for key, size, limit in (("A", n, MAX_SIZE), ("Bu", Bu.shape[1], MAX_SIZE),
                             ("C", len(C), MAX_SENSORS)):
        if size > limit:
            plant.fail(key, f"is too large: {size}, at most {limit} are supported")
    Q = covariance(plant, "Q", B.shape[1])
    if plant.boolean("continuous"):
        with np.errstate(over="ignore", invalid="ignore"):
            A, Bu, B, Q = discretise(A, Bu, B, Q, dt_s)
        if not all(np.isfinite(matrix).all() for matrix in (A, Bu, Q)):
            plant.fail("A", f"discretised over dt_s = {dt_s:g} s is beyond double precision; "
                            "check its units and dt_s")
    return {"n": n, "m": len(C), "l": Bu.shape[1], "A": A, "Bu": Bu, "B": B, "C": C, "Q": Q,
            "x0": plant.vector("x0", n, default=np.zeros(n)),
            "P0": covariance(plant, "P0", n) if plant.has("P0") else None}


def discretise(A: Array, Bu: Array, B: Array, Q: Array,
               dt_s: float) -> tuple[Array, Array, Array, Array]:
    """Discrete A, Bu (zero-order hold), B = I and Q (from a density) over dt_s.

    C. F. Van Loan, "Computing integrals involving the matrix exponential", IEEE TAC 1978.  His Q
    comes from exp(-A dt), which swamps it where A decays fast; there from a part of dt, by
    Q(2 t) = Q(t) + A(t) Q(t) A(t)'.
    """
    n, inputs = Bu.shape
    hold = expm(np.block([[A, Bu], [np.zeros((inputs, n + inputs))]]) * dt_s)
    size = np.linalg.norm(A, 1) * dt_s
    halvings = max(0, int(np.ceil(np.log2(size / LOAN_SIZE)))) if size > 0.0 else 0
    part = dt_s / 2.0**halvings
    loan = expm(np.block([[-A, B @ Q @ B.T], [np.zeros((n, n)), A.T]]) * part)
    Qd = loan[n:, n:].T @ loan[:n, n:]
    for k in range(halvings):
        step = expm(A * (part * 2.0**k))
        Qd = Qd + step @ Qd @ step.T
    return hold[:n, :n], hold[:n, n:], np.eye(n), (Qd + Qd.T) / 2


def covariance(reader: Reader, key: str, size: int, definite: bool = False,
               labels: list[str] | None = None) -> Array:
    """[size, size] symmetric positive semidefinite (or definite) matrix, or its diagonal."""
    S = reader.matrix_or_diagonal(key, size)
    scale = max(np.abs(S).max(), np.finfo(float).tiny)
    i, j = np.unravel_index(np.abs(S - S.T).argmax(), S.shape)
    if abs(S[i, j] - S[j, i]) > SYMMETRY * scale:
        reader.fail(key, f"is not symmetric: row {i + 1}, column {j + 1} is {S[i, j]:.9g} "
                         f"but row {j + 1}, column {i + 1} is {S[j, i]:.9g}")
    S = (S + S.T) / 2
    for i in range(size):
        if S[i, i] < 0 or (definite and S[i, i] <= 0):
            label = f" ({labels[i]})" if labels else ""
            reader.fail(key, f"has the variance {S[i, i]:.9g} in row {i + 1}{label}; it must be "
                             + ("positive" if definite else "at least 0"))
    d = np.sqrt(np.where(np.diag(S) > 0, np.diag(S), 1.0))
    smallest = np.linalg.eigvalsh(S / np.outer(d, d))[0]
    if definite and smallest <= size * np.finfo(float).eps:
        reader.fail(key, "is not positive definite: the smallest eigenvalue of its correlation "
                         f"matrix is {smallest:.3g}")
    if smallest < -SYMMETRY:
        reader.fail(key, "is not positive semidefinite: the smallest eigenvalue of its "
                         f"correlation matrix is {smallest:.3g}")
    return S


def _labels(plant: Reader, parts: dict[str, Any]) -> dict[str, list[str]]:
    """Names of states, sensors and inputs, unique in the C header and in the logs."""
    found = {}
    for key, matrix, size, letter in (("states", "A", "n", "x"), ("sensors", "C", "m", "y"),
                                      ("inputs", "Bu", "l", "u")):
        default = [f"{letter}{i + 1}" for i in range(parts[size])]
        found[key] = plant.strings(key, default)
        if len(found[key]) != parts[size]:
            plant.fail(key, f"has {len(found[key])} names, but {matrix} makes it {parts[size]}")
        names.check_labels(found[key], f"{plant.where}{key}")
    both = set(found["sensors"]) & set(found["inputs"])
    if both:
        plant.fail("inputs", f"uses the name '{min(both)}', which is a sensor's; a log could not "
                             "tell them apart")
    return found


def _measurement(plant: Reader, parts: dict[str, Any]) -> dict[str, Any]:
    m = parts["m"]
    R = covariance(plant, "R", m, definite=True, labels=parts["sensors"])
    return {"R": R, "sample_R": R,
            "offset": plant.vector("offset", m, default=np.zeros(m)),
            "range": plant.ranges("range", m),
            "rate": _rates(plant, parts), "noise_margin": _noise_margin(plant)}


def _noise_margin(plant: Reader) -> float:
    """At least 0, in standard deviations of R."""
    if plant.raw.get("noise_margin", 0) == 0:
        return 0.0
    return plant.positive("noise_margin")


def _rates(plant: Reader, parts: dict[str, Any]) -> Array:
    """[m] share of the steps in which a sensor sends, above 0 and at most 1."""
    rate = plant.vector("rate", parts["m"], default=np.ones(parts["m"]))
    for name, value in zip(parts["sensors"], rate, strict=True):
        if not MIN_RATE <= value <= 1.0:
            plant.fail("rate", f"is {value:g} for {name}; it must be at least {MIN_RATE:g} and at "
                               "most 1")
    return rate


def _attack(attack: Reader, sensors: list[str]) -> dict[str, Any]:
    """p, strong, groups; p counts groups, a sensor in no group being one of its own."""
    strong = attack.strings("strong", [])
    groups = attack.string_lists("groups")
    names.check_known(strong, sensors, f"{attack.where}strong")
    for number, group in enumerate(groups, start=1):
        names.check_known(group, sensors, f"{attack.where}groups, group {number},")
    grouped = [name for group in groups for name in group]
    for name in grouped:
        if grouped.count(name) > 1:
            attack.fail("groups", f"has the sensor '{name}' twice")
    units = len(sensors) - len(grouped) + len(groups)
    p = attack.integer("p", default=1 if units > 1 else 0)
    if not 0 <= p < units:
        what = "groups" if groups else "sensors"
        attack.fail("p", f"is {p}; it must be at least 0 and less than the number of {what}, "
                         f"{units}")
    return {"p": p, "strong": strong, "groups": groups}


def _methods(methods: Mapping[str, Any], where: str) -> dict[str, dict[str, Any]]:
    check_keys(methods, METHOD_NAMES, f"{where}: method")
    for name, options in methods.items():
        if not isinstance(options, Mapping):
            raise ModelError(f"{where}: method.{name} must be a table of options")
    return {name: dict(options) for name, options in methods.items()}
