"""Tumour anti-angiogenesis: the smallest tumour that a given amount of a drug leaves, full doses and then a singular arc.

Ledzewicz and Schättler, "Analysis of optimal controls for a mathematical model of tumour anti-angiogenesis", Optimal Control Applications
and Methods 29, 2008; Betts 2010, section 6.17; GPOPS-II (Patterson and Rao 2014).
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

GROWTH, BIRTH, DEATH, DRUG, LOSS = 0.084, 5.85, 0.00873, 0.15, 0.02
DOSE, SUPPLY = 75.0, 15.0
LIMIT = ((BIRTH - LOSS) / DEATH) ** 1.5
"""Volume at which an untreated tumour would rest, mm3."""
PUBLISHED = (Published("tumour", 7571.67, 2e-2, "Betts 2010, section 6.17: 7571.67; with three arcs of their own: 7571.68"),)


def problem() -> Problem:
    """Volumes of the tumour and of the vessels that feed it, and the drug used so far."""
    problem = Problem("tumour")
    care = problem.phase("care", t0=0.0, tf=(0.1, 5.0), time_unit="d")
    p = care.state("tumour", bounds=(100.0, LIMIT), initial=LIMIT / 2, unit="mm3")
    q = care.state("vessels", bounds=(100.0, LIMIT), initial=LIMIT / 4, unit="mm3")
    care.state("used", bounds=(0.0, SUPPLY), initial=0)
    u = care.control("dose", bounds=(0, DOSE))
    care.dynamics(tumour=-GROWTH * p * ca.log(p / q), vessels=q * (BIRTH - LOSS - DEATH * ca.exp(2 / 3 * ca.log(p)) - DRUG * u), used=u)
    problem.minimize("tumour", care.final(p), unit="mm3")
    care.guess(tumour=(LIMIT / 2, LIMIT / 4), vessels=(LIMIT / 4, LIMIT / 4), used=(0, SUPPLY), dose=DOSE, tf=1.0)
    return problem
