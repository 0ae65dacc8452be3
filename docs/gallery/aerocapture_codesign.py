r"""Aerocapture: shape and bank profile together

The shape of the [capsules](aerocapture.md) and the [bank profile](aerocapture_bank.md) are chosen together, with three objectives:
how compact the capsule is, its heat shield, and the burn that is left at the apoapsis. Armellin and Lavagna, Journal of Artificial
Evolution and Applications 2008, work in two steps; see [the page](../aerocapture.md) that compares both.
"""

from macs import sweep
from problems import load

front = sweep(load("aerocapture_codesign", shape=2, delta_v=45.0), points=6, starts=1)
print(front.table())
some = [0, len(front) // 2, len(front) - 1]
for i in some:
    print(f"#{i}:", {name: round(value, 3) for name, value in front[i].parameters.items()})
front.plot(marked=some)
front.plot_trajectories(some)

# What was learned
#
# The three objectives are in conflict: #0 is the most compact capsule, 0.50 1/m², #4 has the lightest heat shield, 5.2 %, and
# both leave the air as steeply as the limit of 45 m/s allows; #5 has the smallest burn, 30.2 m/s, of a flight that stays high and
# long, and a shield of 9.0 %. The points between save on two at a time: #3 has a shield of 6.1 % and a burn of 33.7 m/s, and is
# less compact. All three flights of the picture lift up at first and, with one fast roll, down for the rest. All points are
# verified; with 33 gradient solves from one start they are local optima. They are blunt capsules, with lift at negative angles of
# attack: slender ones are another piece of the front, which a start with `shape=1` finds.
