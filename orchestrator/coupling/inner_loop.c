/* The master's inner loop over FMI 2.0 function pointers: gather inputs, set, step, get, and note where outputs went.
   `loop.py` describes the same structures to Python. */
#include <math.h>

#include "clock.h"
#include "fmi.h"

/* Where one output went since somebody last looked: extremes, the last value and change, and how often it turned. */
struct track {
    double low, high, last, change, turns;
};

struct call {
    void *component;
    get_set set_real, get_real;
    do_step step;
    const unsigned *input_references, *output_references;
    double *inputs, *outputs;
    const int64_t *sources; /* index in y of what feeds each input */
    int64_t n_inputs, n_outputs;
    int64_t group;
    double spent; /* seconds inside the FMU's functions, summed up */
    struct track *tracks; /* one for each output */
};

enum { SET = 1, STEP = 2, GET = 3, NOT_FINITE = -1 };

/* Note new outputs; the index of the first that is no finite number, or -1. */
static int64_t follow(struct track *tracks, const double *values, int64_t n) {
    for (int64_t i = 0; i < n; ++i) {
        struct track *t = &tracks[i];
        const double value = values[i], change = value - t->last;
        if (!isfinite(value)) return i;
        if (value < t->low) t->low = value;
        if (value > t->high) t->high = value;
        if (change * t->change < 0) t->turns += 1;
        if (change != 0) t->change = change;
        t->last = value;
    }
    return -1;
}

/* Do `count` communication steps from `index`. Returns 0, or the status of the call that failed with
   failure = {steps completed, call, SET | STEP | GET}; or NOT_FINITE with failure = {steps completed, call, output}.
   Calls of one group stand together, in order. */
EXPORT int advance(struct call *calls, int64_t n, const double *y, int64_t index, int64_t count, double step_size,
                   int64_t *failure) {
    for (int64_t k = index; k < index + count; ++k) {
        const double time = (double)k * step_size;
        for (int64_t first = 0, last; first < n; first = last) {
            for (last = first; last < n && calls[last].group == calls[first].group; ++last) {
                struct call *c = &calls[last];
                int status;
                for (int64_t i = 0; i < c->n_inputs; ++i) c->inputs[i] = y[c->sources[i]];
                const double start = seconds();
                if (c->n_inputs && (status = c->set_real(c->component, c->input_references, (size_t)c->n_inputs, c->inputs)) > 1) {
                    failure[0] = k, failure[1] = last, failure[2] = SET;
                    return status;
                }
                if ((status = c->step(c->component, time, step_size, 1)) > 1) {
                    failure[0] = k, failure[1] = last, failure[2] = STEP;
                    return status;
                }
                c->spent += seconds() - start;
            }
            for (int64_t i = first; i < last; ++i) {
                struct call *c = &calls[i];
                int status;
                if (!c->n_outputs) continue;
                const double start = seconds();
                if ((status = c->get_real(c->component, c->output_references, (size_t)c->n_outputs, c->outputs)) > 1) {
                    failure[0] = k, failure[1] = i, failure[2] = GET;
                    return status;
                }
                c->spent += seconds() - start;
                if ((failure[2] = follow(c->tracks, c->outputs, c->n_outputs)) >= 0) {
                    failure[0] = k, failure[1] = i;
                    return NOT_FINITE;
                }
            }
        }
    }
    return 0;
}
