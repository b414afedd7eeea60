/* Connections that change what they carry, as a component between the groups of the inner loop: it is called with the
   same three functions as an FMU. `wire_bank.py` describes the structures to Python and has the same arithmetic. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "fmi.h"

#pragma STDC FP_CONTRACT OFF

struct wire {
    double bias, deviation, keep, fresh, quantum, substitute; /* what it does */
    double coloured, last;                                    /* state of the noise's low-pass; what arrived last */
    int64_t mode, delay, capacity, head, started;
    double *ring;
    const double *white;
};

struct bank {
    struct wire *wires;
    const double *inputs;
    double *outputs;
    int64_t n, position, quiet;
};

enum { PASS = 0, HOLD = 1, SUBSTITUTE = 2 };

EXPORT int wires_set_real(void *bank, const unsigned *references, size_t n, const double *values) {
    return (void)bank, (void)references, (void)n, (void)values, 0; /* the inputs are gathered where they are read */
}

EXPORT int wires_get_real(void *bank, const unsigned *references, size_t n, double *values) {
    return (void)bank, (void)references, (void)n, (void)values, 0; /* the outputs are written where they are read */
}

EXPORT int wires_step(void *of, double time, double step_size, int kept) {
    struct bank *bank = of;
    (void)time, (void)step_size, (void)kept;
    for (int64_t i = 0; i < bank->n; ++i) {
        struct wire *w = &bank->wires[i];
        double value = bank->inputs[i];
        if (w->bias != 0) value += w->bias;
        if (w->deviation != 0 && !bank->quiet) {
            const double now = w->white[bank->position];
            if (w->started) {
                const double old = w->keep * w->coloured, new = w->fresh * now;
                w->coloured = old + new;
            } else {
                w->coloured = now;
            }
            w->started = 1;
            const double added = w->deviation * w->coloured;
            value += added;
        }
        if (w->quantum != 0 && !bank->quiet) value = w->quantum * nearbyint(value / w->quantum);
        if (w->capacity) {
            w->ring[w->head] = value;
            value = w->ring[(w->head - w->delay + w->capacity) % w->capacity];
            w->head = (w->head + 1) % w->capacity;
        }
        if (w->mode == HOLD) value = w->last;
        if (w->mode == SUBSTITUTE) value = w->substitute;
        w->last = bank->outputs[i] = value;
    }
    bank->position += 1;
    return 0;
}
