"""The equation of motion of many vesicles, without a matrix over all of them.

It has the same terms as `solver.dynamics`, which keeps matrices over all points and serves few vesicles.
Sums over far points are made as they are needed; what near pairs of vesicles add to them, and what each
vesicle does to itself, is kept as small blocks.
"""

from solver.suspension.dynamics import Suspension

__all__ = ["Suspension"]
