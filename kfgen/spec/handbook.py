"""What a filter costs, what fixed point holds, how a log makes one trusted: as the reference prints it."""

HANDBOOK = """
## What it costs

A bank of two ud + bierman filters of three states (imm3 in the tests) takes 904 instructions, 2856 bytes of flash and
104 of RAM, against 10404, 8520 and 824 of YAFL's. In loops (`unroll: none`) chain16 takes 16773 instructions in 2276
bytes (ud + bierman) and 9844 in 2672 (full + standard), with the flags that the header names. Every float and double
filter has both forms; one in fixed point is written out, since its elements have binary points of their own.

`kfgen cost SPEC` measures any filter so, on Cortex-M0 to M33, RISC-V, AVR or the host; `pip install 'kfgen[cost]'`
brings a cross compiler and the emulator for Cortex-M and RISC-V, and gcc is preferred where it is installed.

On cv4 in ud + bierman `robust` adds 23 % to the instructions (54 of 240) and `adaptive` 21 %; a filter without them
has not one instruction of either. Which option is for what stands above.

`-O2 -fno-math-errno` (else a square root keeps a call beside the instruction). Where a filter has 8 states or more,
its header names further flags for its file, which keep more of the long functions in registers. Leave floating-point
contraction as the compiler has it: a fused multiply-add is faster and rounds once. Never `-ffast-math`.

## Fixed point

`scalar: q16.16` (any `q<m>.<n>`) emits integers only, for cores without an FPU. kfgen runs the filter over logs that
it draws from the spec's own model, all over the ranges that the spec declares of states, inputs, parameters and dt,
and over a log of yours (`fixed: {log: drive.csv}`; `build --log`, which `check`, `run` and `cost` take as
`--ranges`), gives each quantity a binary point of its own, and prints the table. `kfgen check` says how many
operations are proved to fit in the declared ranges, how many only runs have shown to, and how far these have gone.
What 32 bits cannot hold is refused, with a range that would do; getters return a status, for a P may not fit. Declare
a `range` where you know one, and gate what may be far off. Where a step adds less to a variance than its LSB can
tell, what is rounded away is carried on in a second word (`rest`). It pays on cores with a 32-bit multiplier: on a
Cortex-M0 cv4 takes 2545 instructions (full + standard) and 6171 (ud + bierman), with soft float 9164 and 18989. It
does not pay on an 8-bit AVR, where cv4 takes 17682 cycles (37700 with C's own products and division) and soft float
14035; nor on a core with an FPU; nor where a standard deviation falls by more than the format holds (`specs/gps.yaml`
is refused). There it is for equal bits on all targets. `python -m tests.benchmarks.fixed` measures this; `python -m
tests.fixed.eva` has Frama-C look for undefined behaviour in ball and cv4, whatever they are given.

## Far from the origin

A float of 4.2e6 m has its last digit at half a metre: a step of 0.15 m is lost on it, silently. Use a local origin,
`scalar: double`, or `code: {compensated: [x, y]}`, which carries on in a second word what rounding leaves: x +
`x_rest` is the estimate. Over 15 s at 17 m/s a plain float filter goes 80 m astray, a compensated one 8 mm
(`tests/native/test_compensated.py`).

## In C++

The headers compile as C++ too, and there is no view of spans beside them: fields and indices have names already
(`kf.x[VEHICLE_SPEED]`), getters take arrays, and a second interface would have to be learnt and kept in step to save
nothing.

## From a log to trust

`kfgen report vehicle.yaml --log drive.csv -o report.html` writes one page that a reviewer can sign: the equations,
what the sensors can tell (singular values, the weakest direction, what each sensor is needed for), estimates with
their 2-sigma bands, innovations with their bounds, the mean NIS with the interval in which it is consistent,
whiteness (Ljung-Box) and normality, NEES and RMSE where the log has columns `true.<state>`, how much of each state's
variance comes from each noise, sensor and the start (linear covariance analysis), costs on a target, formats of fixed
point. It has no script and fetches nothing; `--json` prints the same figures. Of a quaternion all this is of its three
errors. With `history`, estimates and NIS are those of the filter that takes late readings; innovations, whiteness and
budget are of the readings put back to where they were made.

`kfgen tune vehicle.yaml monday.csv tuesday.csv -o tuned.yaml` maximises the likelihood of the innovations, over all
noises or over the numbers that `--free` names. Each becomes a parameter of one compiled filter, so that a trial costs
a run at C speed. It prints old, new, standard error, what moves together, and what the logs cannot tell ("only their
sum"), and judges by the last fifth of each log, which it does not fit (`--holdout`). Believe it only where the
held-out likelihood rises too, and what you need is what it judges by: one step ahead. On a cell's cycle
(`specs/battery.yaml`) the fitted part gains and the rest loses, for errors that last 20 s are no noise. On a drive
(`specs/vehicle.yaml`) both gain, by a gyro noise after which the heading is open to 1.7 rad when fixes fail for 10 s;
neither example was changed. What the gate rejects, and with `--robust` all beyond the 99.9 % limit, pulls no more
than two or three good measurements.

`kfgen smooth vehicle.yaml drive.csv -o smoothed.csv` runs the fixed-interval smoother (Rauch-Tung-Striebel; of a ukf
in its sigma-point form) in numpy. It never knows less than the filter, and equals least squares over the whole track
where the model is linear. Late readings are taken in where they were made.
Refused, with the reason: `imm`, `ekf2`, `adapt_R`, `adapt_Q`.
""".strip()
