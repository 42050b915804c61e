# SPDX-License-Identifier: MIT
"""[D] without any shortcut: the oracle of the tests of `decentral`, and plants to run it on.

States z_i = Z_i' x as they are, every set of sensors fused by itself from its own part of P.
"""

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from blw import chi2, kalman, model
from blw.decentral_filters import local_filters
from blw.decentral_fusion import candidates


class Reference:
    """The estimator of [D] with mu_J - n degrees of freedom and readmission.

    gains "steady" or "recursive"; P0 [n, n] is the covariance of x(0)
    """

    def __init__(self, plant, false_alarm=1e-3, readmit=20, gains="steady", P0=None):
        self.plant, self.readmit = plant, readmit
        self.filters = local_filters(plant)
        first = self.filters.first
        self.S = block_diag(*self.filters.S)
        self.t = block_diag(*(t[None, :] for t in self.filters.t))
        self.K = block_diag(*(self.filters.K[first[i]:first[i + 1], None]
                              for i in range(plant.m)))
        self.recursive = gains == "recursive"
        Phi = self.filters.Phi
        self.P = Phi @ P0 @ Phi.T if self.recursive else self.filters.P
        self.z = Phi @ plant.x0
        self.excluded, self.passes, self.false_alarm = (), 0, false_alarm

    def dof(self, gone):
        """mu_J - n."""
        mu = self.filters.mu
        return int(mu.sum() - sum(mu[i] for i in gone)) - self.plant.n

    def fuse(self, gone):
        """x_J [n] and g_J without the sensors `gone`."""
        rows = self._rows(gone)
        L = np.linalg.cholesky(self.P[np.ix_(rows, rows)])
        Phi = solve_triangular(L, self.filters.Phi[rows], lower=True)
        z = solve_triangular(L, self.z[rows], lower=True)
        x = np.linalg.lstsq(Phi, z, rcond=None)[0]
        return x, float(np.sum((z - Phi @ x)**2))

    def residual(self, gone):
        """[mu_J, mu] z to the whitened residual of the fusion without `gone`."""
        rows = self._rows(gone)
        L = np.linalg.cholesky(self.P[np.ix_(rows, rows)])
        Phi = solve_triangular(L, self.filters.Phi[rows], lower=True)
        Linv = solve_triangular(L, np.eye(len(L)), lower=True)
        spread = np.zeros((len(rows), len(self.P)))
        spread[:, rows] = Linv - Phi @ np.linalg.pinv(Phi) @ Linv
        return spread

    def step(self, y, u=None):
        """x_hat [n], g of all sensors, the sensors left out."""
        self._advance(y, u)
        x, g = self.fuse(self.excluded)
        g_all = self.fuse(())[1] if self.excluded else g
        self.passes = self.passes + 1 if g_all <= self._threshold(()) else 0
        if self.excluded and 0 < self.readmit <= self.passes:
            self.excluded = ()
            x = self.fuse(())[0]
        elif g > self._threshold(self.excluded):
            x = self._search()
        return x, g_all, self.excluded

    def _rows(self, gone):
        first = self.filters.first
        return np.concatenate([np.arange(first[i], first[i + 1])
                               for i in range(self.plant.m) if i not in gone])

    def _threshold(self, gone):
        return chi2.threshold(self.false_alarm, self.dof(gone))

    def _search(self):
        fits = {gone: self.fuse(gone) for gone in candidates(self.plant)}
        best = max(fits, key=lambda gone: chi2.log_sf(fits[gone][1], self.dof(gone)))
        if best != self.excluded:
            self.excluded, self.passes = best, 0
        return fits[best][0]

    def _advance(self, y, u):
        plant, Phi = self.plant, self.filters.Phi
        z = self.S @ self.z + (0.0 if u is None else Phi @ plant.Bu @ u)
        if self.recursive:
            self._recursion()
        self.z = z + self.K @ (y - plant.offset - self.t @ z)

    def _recursion(self):
        Phi = self.filters.Phi
        Pp = self.S @ self.P @ self.S.T + Phi @ self.plant.W @ Phi.T
        for i in range(self.plant.m):
            rows = self.filters.rows(i)
            t, own = self.filters.t[i], Pp[rows, rows]
            self.K[rows, i] = own @ t / (t @ own @ t + self.plant.R[i, i])
        keep = np.eye(len(Pp)) - self.K @ self.t
        P = keep @ Pp @ keep.T + self.K @ self.plant.R @ self.K.T
        self.P = (P + P.T) / 2.0


def random_plant(n, m, p, seed):
    """A stable plant with correlated R, two inputs, offsets and x0; Model and Kalman."""
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((n, n))
    A /= 1.02 * np.abs(np.linalg.eigvals(A)).max()
    L = generator.standard_normal((m, m))
    plant = {"A": A, "Bu": generator.standard_normal((n, 2)), "x0": generator.standard_normal(n),
             "C": generator.standard_normal((m, n)), "offset": generator.standard_normal(m),
             "Q": 0.1 * np.eye(n), "R": 0.2 * np.eye(m) + 0.05 * L @ L.T}
    return parse(plant, p)


def parse(plant, p, **attack):
    """Model and Kalman of a plant given by its matrices."""
    plant = {key: np.asarray(value).tolist() for key, value in plant.items()}
    made = model.parse({"name": "plant", "dt_s": 0.1, "plant": plant, "attack": {"p": p, **attack}},
                       "plant")
    return made, kalman.steady_state(made.A, made.C, made.W, made.R)


def simulate(plant, kalman_filter, steps, generator, u=None):
    """x, y for steps 1..; x(0) - x0 has the covariance P; u [steps, l] acts before each step."""
    root_W = np.linalg.cholesky(plant.W)
    root_R = np.linalg.cholesky(plant.R)
    x = plant.x0 + np.linalg.cholesky(kalman_filter.P) @ generator.standard_normal(plant.n)
    X, Y = np.empty((steps, plant.n)), np.empty((steps, plant.m))
    for k in range(steps):
        x = plant.A @ x + root_W @ generator.standard_normal(plant.n)
        if u is not None:
            x = x + plant.Bu @ u[k]
        X[k] = x
        Y[k] = plant.C @ x + plant.offset + root_R @ generator.standard_normal(plant.m)
    return X, Y
