r"""Welded beam

A beam is welded to a support and loaded at its end with 6000 lb. Thickness and length of the weld, and height and width of the
beam, decide what it costs and how far it bends, within limits of shear, bending and buckling. There are no trajectories: the
problem is a function. Deb, "Evolutionary algorithms for multi-criterion optimization in engineering design", 1999; the beam is that
of Ragsdell and Phillips, 1976.
"""

from macs import MACS
from problems import load

front = MACS(archive=12).solve(load("welded_beam"), seed=1)
print(front.table())
front.plot(marked=[0, 5, 11])
front.plot_variables()

# What was learned
#
# Cost and deflection are in hard conflict: each further dollar buys less stiffness, and the knee of the front is near #6.
# The height of the beam is at its bound of 10 in nearly all along the front, its width makes the compromise up to 5 in, and at the
# cheap end the weld is nearly as thick as the beam is wide. Along the stiff part the weld wanders: there it hardly counts in the
# cost, and a search without derivatives does not settle it. The search ended by itself; the cheapest beam, where limits meet, is what
# it approaches slowest.
