r"""Re-entry of the greatest cross-range

A shuttle enters at 79 km and is to fly as far across its plane as possible, to an end at 24 km. Angle of attack and bank angle are
the controls, and the time is free. Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM
2010, section 6.1, where the optimum is known to six digits.
"""

from macs import optimize
from problems import load
from problems.cases.reentry import OPTIMA

best = optimize(load("betts"))
print(best.alone().table())
print("final time {:.2f} s; Betts: {} deg after {} s".format(best.trajectory["entry"].tf, *OPTIMA["betts"]))
best.plot(costates=True)

# What was learned
#
# The cross-range is 34.1413 deg, with Betts 34.1412, and the final time agrees in all printed digits. The vehicle banks steeply
# at first and rolls out evenly; its angle of attack hardly changes until the last turn. The oscillations are those of a glide
# that is too fast for its altitude. No bound acts but that of the bank angle at the very end. It took 17 gradient solves on a
# mesh that was refined until it and a simulation agreed.
