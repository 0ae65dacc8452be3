"""The table of the orbit rise's true front, row by row, from the necessary conditions of optimality."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from problems.cases import orbit_rise

A = orbit_rise.ACCELERATION


def hamiltonian_flow(_: float, y: np.ndarray) -> list[float]:
    """States r, vr, vt and costates under the angle that maximises the Hamiltonian: thrust along the costate of the velocity."""
    r, vr, vt, lr, lvr, lvt = y
    norm = np.hypot(lvr, lvt)
    return [
        vr,
        vt**2 / r - 1 / r**2 + A * lvr / norm,
        -vt * vr / r + A * lvt / norm,
        lvr * (vt**2 / r**2 - 2 / r**3) - lvt * vt * vr / r**2,
        -lr + lvt * vt / r,
        -2 * lvr * vt / r + lvt * vr / r,
    ]


def test_rows_satisfy_the_necessary_conditions() -> None:
    for tf, energy, *costates in orbit_rise.reference_with_costates()[::24]:
        start = [orbit_rise.START_RADIUS, 0.0, orbit_rise.START_RADIUS**-0.5, *costates]
        r, vr, vt, lr, lvr, lvt = solve_ivp(hamiltonian_flow, (0.0, tf), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert abs((vr**2 + vt**2) / 2 - 1 / r - energy) < 1e-9
        np.testing.assert_allclose([lr, lvr, lvt], [1 / r**2, vr, vt], atol=1e-8)


def test_reference_is_a_front() -> None:
    reference = orbit_rise.reference()
    assert reference.shape == (241, 2)
    assert (np.diff(reference, axis=0) > 0).all()
    np.testing.assert_allclose(-reference[[0, -1], 1], [0.28345965587, -0.05344446957], atol=1e-10)


@pytest.mark.slow
def test_the_optimal_flight_is_a_flight_of_its_control_and_ends_where_the_front_says() -> None:
    for tf in (20.0, 33.3, 80.0):
        flight = orbit_rise.optimal_flight(tf, points=4001)
        t = flight["time"]

        def rates(time: float, x: np.ndarray, t=t, flight=flight) -> list[float]:
            (r, vr, _, vt), u = x, np.interp(time, t, flight["u"])
            return [vr, vt**2 / r - 1 / r**2 + A * np.cos(u), vt / r, -vt * vr / r + A * np.sin(u)]

        found = solve_ivp(rates, (0.0, tf), [orbit_rise.START_RADIUS, 0.0, 0.0, orbit_rise.START_RADIUS**-0.5], rtol=1e-9, atol=1e-10)
        r, vr, theta, vt = found.y[:, -1]
        np.testing.assert_allclose([r, vr, theta, vt], [flight[name][-1] for name in ("r", "vr", "theta", "vt")], atol=1e-6)
        reference = orbit_rise.reference()
        near = np.argsort(np.abs(reference[:, 0] - tf))[:4]
        expected = np.polynomial.Polynomial.fit(*reference[near].T, 3)(tf)
        assert abs((vr**2 + vt**2) / 2 - 1 / r - expected) < 1e-6
    with pytest.raises(ValueError, match="from 20 to 80"):
        orbit_rise.optimal_flight(81.0)
