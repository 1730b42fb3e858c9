/* Random calls of the history of `wave`; prints how many were taken, refused, and too old. */
#include <stdio.h>
#include <stdlib.h>

#include "wave_history.h"

static uint32_t state = 12345u;

static uint32_t draw(uint32_t below)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % below;
}

static float real(void)
{
    return (float)draw(2001u) / 1000.0f - 1.0f;
}

int main(int count, char **arguments)
{
    static wave_history_t h; /* and a neighbour, so that a write beyond it is seen */
    unsigned long taken = 0, refused = 0, old = 0;
    const long calls = count > 1 ? strtol(arguments[1], NULL, 10) : 1000;
    wave_history_init(&h);
    for (long i = 0; i < calls; i++) {
        wave_inputs_t u = {real()};
        if (draw(40u) == 0u) { u.push = 1.0f / 0.0f; }
        const wave_pair_t pair = {real(), real()};
        const wave_one_t one = {real()};
        const float x[3] = {real(), real(), real()};
        const float P[9] = {1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, draw(4u) == 0u ? -1.0f : 1.0f};
        const uint32_t age = draw(30u) == 0u ? 0xffffffffu - draw(20u) : draw(12u);
        uint32_t status = 0u;
        switch (draw(64u)) {
        case 0: status = wave_history_set_state(&h, x); break;
        case 1: status = wave_history_set_covariance(&h, P); break;
        case 2: status = draw(9u) == 0u ? wave_history_init(&h) : 0u; break;
        case 3: h.kf.parameters.q = real(); break;
        case 4: status = wave_history_update_one(NULL, &one, &u, age); break;
        default:
            switch (draw(4u)) {
            case 0: status = wave_history_update_pair(&h, &pair, age); break;
            case 1: status = wave_history_update_pair_masked(&h, &pair, draw(5u), age); break;
            case 2: status = wave_history_update_one(&h, &one, &u, age); break;
            default: status = wave_history_predict(&h, &u, draw(20u) == 0u ? -1.0f : 0.1f); break;
            }
        }
        if (status == WAVE_TOO_OLD) {
            old++;
        } else if (status >= WAVE_ERROR) {
            refused++;
        } else {
            taken++;
        }
    }
    printf("%lu %lu %lu\n", taken, refused, old);
    return 0;
}
