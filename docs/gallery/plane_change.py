r"""Plane change in the atmosphere

An orbit is turned by 18 degrees by the lift of a winged vehicle that dips into the atmosphere. The speed at the end is to be as
large as possible, and the heating rate at most 800 Btu/ft²/s. Miele, Lee and Mease, Journal of the Astronautical Sciences 35, 1987;
Betts, "Practical Methods for Optimal Control Using Nonlinear Programming", third edition, 2020, chapter 10.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/plane_change"))
print(best.alone().table())
known = published("plane_change")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
print(f"peak of the heating: {best.trajectory['flight']['heating'].max():.0f}")
best.plot(costates=True)

# What was learned
#
# Nearly all of the turn is made in one dip of some hundred seconds, at the lowest altitude; before and after the vehicle glides.
# The peak of the heating rate is 772: the limit of 800 does not act. The speed agrees with the published one to 0.001 ft/s. It
# took 75 gradient solves, most of them from other starts, which led to nothing better.
