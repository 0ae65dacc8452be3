r"""Sounding rocket in three phases

The greatest height of a rocket with drag, in three phases: full thrust, a singular arc, and none.

$$\dot h = v, \quad \dot v = \frac{T - D(h, v)}{m} - g, \quad \dot m = -\frac{T}{c}$$

In the singular phase the thrust is left to be found; `constrained=True` states the condition that theory knows of it. Bryson and
Ho, "Applied Optimal Control", 1975, section 8.3; Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear
Programming", SIAM 2010, chapter 4; with the data of YAPSS, in feet and slugs.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/sounding_rocket"))
print(best.alone().table())
known = published("sounding_rocket")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# Full thrust, then a thrust that holds the speed nearly constant while the mass falls, then a coast. Since each arc is a phase of
# its own, the thrust is smooth within it, and the height agrees with YAPSS in all printed digits, 18550.8719 ft; on [another
# rocket](rocket.md), in one phase, the mesh has to find the arcs. The Hamiltonian is 0 in all phases, as the times are free. The
# limits of the thrust do not act in the singular phase.
