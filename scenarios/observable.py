"""The verdict *observable*, from geometry and photometry alone: nothing of it comes from an estimator.

Observable: in view of both cameras; visible over at least a quarter of the rows in both; its drop column at least
1.5 drop widths + 3 px from every other leak's in both; and a noise-free column aggregate of at least 5 standard
deviations of the aggregate under the clip's noise, in both.
"""

LEAST_VISIBLE_FRACTION = 0.25
LEAST_SNR = 5.0
SEPARATION_DROP_WIDTHS = 1.5
SEPARATION_PX = 3.0
