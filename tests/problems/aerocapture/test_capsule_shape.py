"""Sphere, cone and frustum: volumes against bodies of revolution, sizes against Table 2, and what is no capsule."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from problems.cases.aerocapture.designs import BOUNDS, shapes_of
from problems.cases.aerocapture.printed import TABLE_2
from problems.cases.aerocapture.shape import capsules, faults

GOOD = {"nose": 0.5, "rear": 0.4, "front_angle": 0.8, "rear_angle": 0.6}


def revolved(base: float, nose: float, rear: float, front: float, back: float) -> tuple[float, float]:
    """Volume by quadrature of the outline, and length: a circle about (nose, 0), its tangent to the base, a line to the back."""
    touch = nose * (1.0 - np.sin(front))
    widest = touch + (base - nose * np.cos(front)) / np.tan(front)
    end = widest + (base - rear) * np.tan(back)

    def outline(x: float) -> float:
        if x < touch:
            return float(np.sqrt(nose**2 - (x - nose) ** 2))
        if x < widest:
            return float(base - (widest - x) * np.tan(front))
        return float(base - (x - widest) / np.tan(back))

    pieces = [(0.0, touch), (touch, widest), (widest, end)]
    return sum(quad(lambda x: np.pi * outline(x) ** 2, *piece, epsabs=1e-13, epsrel=1e-12)[0] for piece in pieces), end


def test_volumes_are_those_of_bodies_of_revolution():
    X = np.random.default_rng(3).uniform(*np.array(BOUNDS).T, (25, 5))
    shapes, _ = shapes_of(X)
    for i in range(len(X)):
        volume, length = revolved(*(a[i] for a in (shapes.base, shapes.nose, shapes.rear, shapes.front_angle, shapes.rear_angle)))
        assert volume == pytest.approx(5.0, rel=1e-9)
        assert shapes.length[i] == pytest.approx(length, rel=1e-12)
    np.testing.assert_allclose(shapes.volume, 5.0, rtol=1e-12)


def test_the_printed_shapes_have_the_printed_size():
    """The radius of the base follows from the volume; the printed ones have three digits. Of the fourth, with the mended rear angle."""
    shapes, _ = shapes_of(np.array([p.design for p in TABLE_2.values()]))
    np.testing.assert_allclose(shapes.base, [p.base for p in TABLE_2.values()], rtol=0.006)
    np.testing.assert_allclose(shapes.packing, [p.packing for p in TABLE_2.values()], atol=0.011)
    printed, _ = revolved(1.69, 1.52, 0.48, np.radians(69.64), np.radians(42.07))
    assert printed > 6.0, "the printed rear angle of the fourth does not give 5 m3"


def test_packing_counts_the_greatest_dimension():
    slender, flat = capsules([0.2, 0.9], [0.9, 0.9], np.radians([10.0, 70.0]), np.radians([60.0, 5.0])), 2
    assert len(slender.base) == flat
    np.testing.assert_allclose(slender.packing, [slender.length[0] / 5.0, 2.0 * slender.base[1] / 5.0])
    assert slender.length[0] > 2.0 * slender.base[0]


@pytest.mark.parametrize(
    ("change", "attack", "reason"),
    [
        ({"nose": 1.6, "front_angle": 0.5}, 0.0, "no volume"),
        ({"nose": 0.0}, 0.0, "nose radius"),
        ({"nose": np.nan}, 0.0, "not finite"),
        ({"rear": 1.2}, 0.0, "radius of the back"),
        ({"front_angle": 0.0}, 0.0, "front cone"),
        ({"front_angle": 1.6}, 0.0, "front cone"),
        ({"rear_angle": -0.1}, 0.0, "rear angle"),
        ({"rear_angle": 1.2}, -0.5, "rear cone is lit"),
        ({}, 1.6, "angle of attack"),
    ],
)
def test_what_is_no_capsule_has_a_reason(change, attack, reason):
    found = faults(**GOOD | change, attack=np.array([0.0, attack]))
    assert reason in found[1]
    if not attack:
        with pytest.raises(ValueError, match=reason):
            capsules(**GOOD | change)


def test_good_rows_among_faulty_ones_have_no_reason():
    found = faults(np.array([0.5, -1.0, 0.9]), 0.4, 0.8, 0.6, np.radians([-30.0, 0.0, 30.0]))
    assert [bool(reason) for reason in found] == [False, True, False]


@pytest.mark.parametrize("volume", [0.0, -5.0, np.inf])
def test_a_volume_must_be_one(volume):
    with pytest.raises(ValueError, match="volume"):
        capsules(**GOOD, volume=volume)
