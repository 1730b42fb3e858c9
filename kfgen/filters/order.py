"""The order of the states inside a factored filter: a search over the structure of F, H and Q.

A U D U^T filter costs what its fill-in costs, and that depends on the order. The search is deterministic: it
counts evaluations, not seconds.
"""

from __future__ import annotations

from itertools import permutations

ELEMENT, FRESH, PIVOT = 4, 3, 9  # relative costs of an element of U met again, met first, and of a pivot
EXHAUSTIVE = 5  # up to this many states every order is tried
EVALUATIONS = 2500  # of at most 32 states; of more so many fewer as each takes longer


def best_order(F: list[set[int]], noisy: set[int], measured: list[set[int]]) -> list[int]:
    """The cheapest order found. F[i]: columns of row i of F that are not zero; noisy: states with process noise;
    measured: the states in each row of H. Returns states, first inner position first."""
    n = len(F)
    columns = [{i for i in range(n) if k in F[i]} for k in range(n)]

    def cost(order: list[int], limit: int = 1 << 60) -> int:
        return _cost(order, columns, noisy, measured, limit)

    if n <= EXHAUSTIVE:
        return min((list(p) for p in permutations(range(n))), key=lambda p: (cost(p), p))
    best = min((list(range(n)), list(reversed(range(n)))), key=cost)
    best_cost = cost(best)
    left = EVALUATIONS * 1024 // max(1024, n * n)
    improved = True
    while improved and left > 0:
        improved = False
        for i in range(n):
            for j in range(n):
                if i == j or left <= 0:
                    continue
                moved = list(best)
                moved.insert(j, moved.pop(i))
                swapped = list(best)
                swapped[i], swapped[j] = swapped[j], swapped[i]
                for candidate in (moved, swapped) if i < j else (moved,):
                    left -= 1
                    c = cost(candidate, best_cost)
                    if c < best_cost:
                        best, best_cost, improved = candidate, c, True
    return best


def upper_order(F: list[set[int]], blocks: list[range]) -> list[int] | None:
    """An order in which F is upper triangular, but for blocks of states that stand together; None: there is none.

    Column k of F U then ends at its own pivot, or in its block. What no other state uses and uses none comes first,
    since a noise costs all before it; else the spec's order stays.
    """
    n = len(F)
    block_of = {i: block[0] for block in blocks for i in block}
    unit = [block_of.get(i, i) for i in range(n)]
    users: dict[int, set[int]] = {u: set() for u in unit}  # what has to come before: the rows that use a state
    for i, row in enumerate(F):
        for j in row:
            if unit[i] != unit[j]:
                users[unit[j]].add(unit[i])
    order: list[int] = []
    placed: set[int] = set()
    while len(placed) < len(users):
        ready = [u for u in users if u not in placed and users[u] <= placed]
        if not ready:
            return None
        alone = [u for u in ready if F[u] == {u} and not any(u in row for i, row in enumerate(F) if i != u)]
        for chosen in sorted(alone or ready):
            placed.add(chosen)
            order += [i for i in range(n) if unit[i] == chosen]
    return order


def _cost(order: list[int], columns: list[set[int]], noisy: set[int], measured: list[set[int]], limit: int) -> int:
    """The cost of an order, or at least `limit` where it is no better."""
    position = {state: k for k, state in enumerate(order)}
    n = len(order)
    U = [0] * n  # bit i of U[j]: U_ij is not zero
    D = [state in noisy for state in order]
    total = 0
    reach = 0
    for row in measured:
        first = min(position[i] for i in row) if row else n
        total += sum(PIVOT + ELEMENT * j for j in range(first, n))
    for state in order:
        if total >= limit:
            return total
        for i in columns[state]:
            reach |= 1 << position[i]
        w = reach  # column k of F U: all columns up to k, U being full above
        while w:
            j = w.bit_length() - 1
            below = (1 << j) - 1
            touched = (w | U[j]) & below
            again = touched & U[j]
            total += PIVOT + ELEMENT * again.bit_count() + FRESH * (touched ^ again).bit_count()
            U[j] = touched
            if not D[j]:
                D[j] = True
                break
            w = touched  # what is left of w is among it
    return total
