"""What the options of a filter are for, as the language's reference prints it."""

GUIDE = """
## Which option for what

The default, an `ekf` with `covariance: ud` and `update: bierman`, is the cheapest that stays positive. The forms differ
in cost and in how they round, not in what they compute.

What each option does, and whether P is then an honest measure of the error ("consistent": the mean NEES of a model
that is right lies in its chi-square band; the tests hold those that promise it to that):

* `kf`, `ekf`: Jacobians at the prior. Consistent for a model that is right and nearly linear.
* `iekf`: linearises h again, at the estimate that the update has reached: for strong curvature of h and a precise
  sensor. Consistent.
* `ekf2`: adds what second derivatives do to mean and covariance; what is linear costs nothing. Consistent, also where
  curvature makes an ekf too sure of itself.
* `ukf`: sigma points instead of derivatives: right to second order, and of use where derivatives are not (kinks,
  strong curvature, angles). Consistent. It costs one run of f, and of an h that is not linear, per point: 2 n + 1.
  `covariance: sqrt` and `ud` never lose positive definiteness to round-off; `sequential: true` is cheap but leaves
  out the covariance of the linearisation error, so that P is too small where h is curved.
* `covariance: sqrt`: a triangular root, with half the range of exponents; one root and one quotient per state and
  scalar measurement. As the ekf.
* `gate`: refuses a whole vector that is improbable. Nearly consistent: true tails are refused too.
* `robust`: weighs each scalar by its own innovation; an outlier moves x little and P not at all. Conservative where
  weights fall: P is larger than a plain filter's.
* `adaptive`: inflates P where an innovation is beyond its quantile, so that the filter follows it. Not consistent: P
  is no posterior any more.
* `adapt_R`, `adapt_Q`: learn R and Q from innovations and corrections. Not consistent while they learn.
* `consider`: leaves states as they are, but counts their uncertainty. Consistent, larger than optimal.
* `gain_limit`, `innovation_floor`, `variance_floor`, `variance_ceiling`: bounds for what must never happen. Where one
  acts P is larger than the model says, with a ceiling smaller.
* `gain: steady`: a constant gain and no covariance at run time. P is that of the steady state, not of the first steps.
* `imm`: several models at once, for a target that switches between them: a filter for each, mixed by the probability
  that it was the other one's turn, and `mu`, the probability of each mode. Consistent where the modes cover what
  happens. Modes should differ; more than three seldom help. A state that a mode does not use should fade in it
  (`a: 0.5*a`), so that it is not stale when the mode that needs it takes over.
  Give `robust` and `adaptive` to all modes or to none: mu is weighed by the updates as they are made, so a mode that
  clips its innovations looks likely whatever it is told. A gate refuses only what all modes would refuse.

`adaptive` is for a target that moves as the model does not say, or a start that is wrong: an innovation that is too
large is then true, and P has to grow until it is believed. An outlier looks the same and is believed too: x jumps to
it. On a constant-velocity track with outliers (the tests' `cv4_outliers`) the RMS position error after an outlier is
65 with `adaptive` alone, 5.4 without, 4.4 with `robust: chernodarov` and 4.2 with `robust: {influence: huber, k: 1.5}`.
Where outliers occur combine it with `robust`, which weighs first (the default quantile is then 0.997), or a `gate`.

`robust` normalises an innovation by the root of R alone. While P is much larger than R, after a start far from the
truth, ordinary innovations count as glitches; huber then gives them no weight in P at all and may never lock on. Start
such a filter with `initialize`; chernodarov recovers more often, since its weight falls in two steps.

A noise input that does not enter linearly (a factor of a state, say) is carried by the sigma points as one more
dimension. Points see second moments: of a product x (1 + e) at x = 0 they see nothing of e. alpha below 0.05 spreads
the points so little that float rounding decides; nothing else suffers, since deviations are taken from the centre's
image and no large weights occur.

nis and the gate always judge by the plain innovation and H P H^T + R, before weights, inflation and changed gains.
`log_likelihood` is that of the update as it was made.

`consider` and `gain_limit` change the gain of each scalar measurement, one after another, after decorrelation.
`innovation_floor` raises the variance of a scalar measurement until its innovation variance is the floor.
A masked update with `adapt_R` adapts the block of R of the components in use; between them and the others R keeps
(1 - a) of itself, so that R stays positive.
""".strip()
