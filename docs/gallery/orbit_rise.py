r"""Low-thrust orbit rise

A spacecraft in the plane rises from a circular orbit of radius 1.1 by a thrust acceleration of 0.01, at an angle $u$ from the local
vertical: in the least time, and with the greatest final energy. Without dimensions:

$$\dot r = v_r, \quad \dot\theta = \frac{v_t}{r}, \quad \dot v_r = \frac{v_t^2}{r} - \frac{1}{r^2} + a \cos u, \quad
\dot v_t = -\frac{v_r v_t}{r} + a \sin u$$

Ricciardi, Vasile and Maddock, IEEE CEC 2016, after Herman and Conway, Journal of Guidance, Control, and Dynamics 19(3), 1996. The
true front is by indirect shooting. The angle is within $[0, \pi]$, as in the authors' implementation.
"""

import numpy as np

from macs import MACS
from problems import load
from problems.cases.orbit_rise import reference

front = MACS().solve(load("orbit_rise"), seed=1)
print(front.table())
off = np.interp(front.objectives[:, 0], *reference().T) - front.objectives[:, 1]
print(f"energies differ from those of indirect shooting by at most {abs(off).max():.0e} DU2/TU2")

front.plot(marked=[0, 5, 9], beside={"indirect shooting": reference()})
front.plot_trajectories([0, 5, 9])

# What was learned
#
# Energy grows nearly evenly with time: there is no knee, and a choice needs a reason from outside. The thrust stays near the
# local horizontal, and sways about it as often as the orbit goes around; in the longer rises it turns outward at the end. Its
# bounds never act. All points are verified.
