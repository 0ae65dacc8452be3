"""The lunar ascent as a black box in numpy: the search of a trajectory problem, without the transcription and its solvers.

Its dynamics are a quadrature of the angles, and a candidate is projected on the two final conditions by minimum-norm Newton steps.
"""

import numpy as np

from macs.evaluation.evaluator import Counts, Evaluation, Evaluator

THRUST, GRAVITY, ALTITUDE = 4e-3, 1.6e-3, 10.0
SCALE = np.array([12.0, 20.0])


class Ascent(Evaluator):
    """28 angles at the Gauss-Legendre nodes of four elements, and the time of flight; least time, greatest horizontal speed."""

    def __init__(self):
        self.free = np.arange(29)
        self.lower, self.upper = np.r_[np.full(28, -np.pi / 2), 100.0], np.r_[np.full(28, np.pi / 2), 250.0]
        self.period, self.tolerance, self.counts = np.zeros(29), 1e-9, Counts()
        nodes, weights = np.polynomial.legendre.leggauss(7)
        self.left = 1 - ((np.arange(4)[:, None] + (nodes + 1) / 2) / 4).ravel()  # fraction of the flight that is left at each node
        self.weights = np.tile(weights / 8, 4)

    def first_guess(self, candidates):
        return np.array(candidates, dtype=float)

    def _final(self, Z):
        """Scaled errors (k, 2) of altitude and vertical speed, and their derivatives (k, 2, 29) in the unit cube."""
        u, tf = Z[:, :28], Z[:, 28:]
        climb = THRUST * np.sin(u) - GRAVITY
        slope = THRUST * np.cos(u)
        altitude, speed = (self.weights * self.left * climb).sum(axis=1), (self.weights * climb).sum(axis=1)
        error = np.stack([altitude * tf[:, 0] ** 2 - ALTITUDE, speed * tf[:, 0]], axis=1)
        by_angles = np.stack([self.weights * self.left * tf**2 * slope, self.weights * tf * slope], axis=1)
        by_time = np.stack([2 * tf[:, 0] * altitude, speed], axis=1)
        jacobian = np.concatenate([by_angles, by_time[:, :, None]], axis=2)
        return error / SCALE, jacobian / SCALE[:, None] * (self.upper - self.lower)

    def _evaluate(self, Z, way=None):
        Z, iterations = Z.copy(), 0
        for _ in range(50):
            error, jacobian = self._final(Z)
            open_ = np.abs(error).max(axis=1) > self.tolerance / 2
            if not open_.any():
                break
            across = jacobian[open_].transpose(0, 2, 1)
            gram = jacobian[open_] @ across + 1e-14 * np.eye(2)
            step = -(across @ np.linalg.solve(gram, error[open_][:, :, None]))[:, :, 0]
            step *= np.minimum(1.0, 0.2 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12))
            Z[open_] = np.clip(Z[open_] + step * (self.upper - self.lower), self.lower, self.upper)
            iterations += int(open_.sum())
        violation = np.abs(self._final(Z)[0]).max(axis=1)
        speed = (THRUST * self.weights * Z[:, 28:] * np.cos(Z[:, :28])).sum(axis=1)
        status = np.where(violation <= self.tolerance, "converged", "infeasible")
        return Evaluation(Z, np.stack([Z[:, 28], -speed], axis=1), violation, status), iterations
