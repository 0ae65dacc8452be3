r"""Moon landing

A lander is to come down softly with the least propellant; its thrust $T$ is at most 1.227:

$$\dot h = v, \quad \dot v = T/m - 1, \quad \dot m = -T/2.349$$

Meditch, IEEE Transactions on Automatic Control 9(4), 1964; with the data of an example of PSOPT. In closed form: no thrust for
0.239259, then full thrust for 1.157549.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/moon_landing"))
print(best.alone().table())
known = published("moon_landing")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# The lander falls freely, then brakes with full thrust to the ground; there is no third piece. An element ends at the switch, so that
# the impulse has all printed digits. The Hamiltonian is 0 since the time is free and does not matter.
