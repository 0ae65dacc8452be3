"""The shuttle of the re-entries, with figures in feet, slugs and Btu; all that is computed is SI but for the heating rate.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1; equations (5) and (9) of
Chai et al., "Solving multiobjective constrained trajectory optimization problem by an extended evolutionary algorithm", IEEE Transactions
on Cybernetics 50(4), 2020, in which the sign of the density's exponent is a slip.
"""

from __future__ import annotations

from ..winged import FOOT, POUND, SLUG, Winged

MASS = 6309.43 * SLUG
PRESSURE = POUND / FOOT**2
"""One lbf/ft2 in Pa."""
SHUTTLE = Winged(
    radius=20902900.0 * FOOT,
    mu=0.14076539e17 * FOOT**3,
    density=0.002378 * SLUG / FOOT**3,
    scale_height=23800.0 * FOOT,
    area=2690.0 * FOOT**2,
    lift=(-0.20704, 1.67556),
    drag=(0.07854, -0.352896, 2.039962),
    heating=(1.0672181, -0.019213774, 2.1286289e-4, -1.0117249e-6),
    # To Btu/ft2/s.
    heating_constant=17700.0 * 1e-4**3.07 * (FOOT**3 / SLUG) ** 0.5 / FOOT**3.07,
)
