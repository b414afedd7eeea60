/* The master's inner loop over FMI 2.0 function pointers: gather inputs, set, step, get, and note where outputs went.
   `compiled_loop.py` describes the same structures to Python. Compiled behind `team.c`, whose threads share the calls of
   a group. */
#include <math.h>
#include <string.h>

/* Where one output went since somebody last looked: extremes, the last value and change, and how often it turned. */
struct track {
    double low, high, last, change, turns;
};

/* Steps several instances of one library at once, as its `gfor_step_stack` (fmus/toolchain/c/stack.c). */
typedef int (*step_together)(void *const *, size_t, double, double, int32_t *status);

/* Calls of one group whose FMUs step together. The first of them leads: it is done for all. */
struct stack {
    step_together step;
    void *const *components;
    const int64_t *calls;
    int32_t *status;
    int64_t n;
};

/* As large as two lines of the processor's cache, so that threads do not write to the same one. */
struct call {
    void *component;
    get_set set_real, get_real;
    do_step step;
    const unsigned *input_references, *output_references;
    double *inputs, *outputs;
    const int64_t *sources; /* index in y of what feeds each input */
    int64_t n_inputs, n_outputs;
    double *fresh; /* where outputs wait until all have stepped, read by a thread or beside others of a stack */
    double spent; /* seconds for inputs and the FMU's functions, summed up */
    struct track *tracks; /* one for each output */
    int32_t status, stage; /* of a call that was refused */
    const struct stack *stack; /* NULL where it steps by itself */
};

/* Calls that step side by side: from `first` to before `last`. Where threads share them, `own` are done by the caller
   alone, and thread k begins with shared[begin[k]]. */
struct group {
    int64_t first, last;
    const int64_t *own, *shared, *begin;
    int64_t n_own;
};

enum { NONE = 0, SET = 1, STEP = 2, GET = 3, NOTE = 4, NOT_FINITE = -1 };

/* Variables of one component that an observer wants after each step, and its rows of them (`noted_steps.py`). */
struct reading {
    void *component;
    get_set get_real;
    const unsigned *references;
    int64_t n;
};

struct rows {
    const struct reading *readings;
    double *values; /* `most` rows of `width` numbers, of which `filled` wait for the observer */
    int64_t n_readings, width, most, filled, index; /* index: of the newest */
};

/* Add a row for the step that ends at `index`; the status of a reading that was refused, which is named by its place. */
static int note(struct rows *rows, int64_t index, int64_t *place) {
    if (rows->filled == rows->most) return 0;
    double *row = rows->values + rows->filled * rows->width;
    for (int64_t i = 0; i < rows->n_readings; ++i) {
        const struct reading *r = &rows->readings[i];
        const int status = r->n ? r->get_real(r->component, r->references, (size_t)r->n, row) : 0;
        *place = i;
        if (status > 1) return status;
        row += r->n;
    }
    rows->filled += 1, rows->index = index;
    return 0;
}

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

/* Gather inputs and set them. What is refused is named in the call. */
static int give_one(struct call *c, const double *y) {
    for (int64_t i = 0; i < c->n_inputs; ++i) c->inputs[i] = y[c->sources[i]];
    c->stage = SET;
    if (c->n_inputs && (c->status = c->set_real(c->component, c->input_references, (size_t)c->n_inputs, c->inputs)) > 1)
        return c->status;
    c->stage = NONE;
    return 0;
}

static int step_one(struct call *c, const double *y, double time, double step_size) {
    if (give_one(c, y)) return c->status;
    c->stage = STEP;
    if ((c->status = c->step(c->component, time, step_size, 1)) > 1) return c->status;
    c->stage = NONE;
    return 0;
}

static int read_one(struct call *c, double *outputs) {
    if (!c->n_outputs) return 0;
    c->stage = GET;
    if ((c->status = c->get_real(c->component, c->output_references, (size_t)c->n_outputs, outputs)) > 1) return c->status;
    c->stage = NONE;
    return 0;
}

/* One communication step of all. */
struct now {
    struct call *calls;
    const double *y;
    double time, step_size;
};

static int leads(const struct now *now, const struct call *c) { return now->calls + c->stack->calls[0] == c; }

static struct call *member(const struct now *now, const struct stack *of, int64_t k) { return now->calls + of->calls[k]; }

/* As `step_one` for all calls of a stack. */
static void step_stack(const struct now *now, const struct stack *of) {
    int refused = 0;
    for (int64_t k = 0; k < of->n; ++k) refused |= give_one(member(now, of, k), now->y);
    if (refused || of->step(of->components, (size_t)of->n, now->time, now->step_size, of->status) <= 1) return;
    for (int64_t k = 0; k < of->n; ++k) {
        struct call *c = member(now, of, k);
        c->status = of->status[k];
        if (c->status > 1) c->stage = STEP;
    }
}

static void read_fresh(struct call *c) {
    if (c->stage == NONE) read_one(c, c->fresh);
}

/* A call of a thread, or those of the stack that it leads. */
static void whole_call(void *of, int64_t which) {
    const struct now *now = of;
    struct call *c = &now->calls[which];
    const struct stack *stack = c->stack;
    const double start = seconds();
    if (!stack) {
        if (!step_one(c, now->y, now->time, now->step_size)) read_one(c, c->fresh);
        c->spent += seconds() - start;
        return;
    }
    step_stack(now, stack);
    for (int64_t k = 0; k < stack->n; ++k) read_fresh(member(now, stack, k));
    const double each = (seconds() - start) / (double)stack->n;
    for (int64_t k = 0; k < stack->n; ++k) member(now, stack, k)->spent += each;
}

/* Step a call; or do the stack that it leads, whose outputs are read while its instances are in the processor's cache:
   after the others they would come from memory. One that follows was done then. */
static void timed_step(struct now *now, struct call *c) {
    if (c->stack) {
        if (leads(now, c)) whole_call(now, c - now->calls);
        return;
    }
    const double start = seconds();
    step_one(c, now->y, now->time, now->step_size);
    c->spent += seconds() - start;
}

static int timed_reading(struct call *c) {
    const double start = seconds();
    const int status = read_one(c, c->outputs);
    c->spent += seconds() - start;
    return status;
}

/* Step a group; the status of what was refused, NOT_FINITE, or 0, and failure = {, call, SET | STEP | GET or output}. */
static int step_group(struct now *now, const struct group *g, struct team *team, int64_t *failure) {
    const int together = team && g->begin;
    if (together) team_do(team, g->own, g->n_own, g->shared, g->begin);
    for (int64_t i = g->first; i < g->last; ++i) {
        struct call *c = &now->calls[i];
        if (!together) timed_step(now, c);
        if (c->stage == SET || c->stage == STEP) {
            failure[1] = i, failure[2] = c->stage;
            return c->status;
        }
    }
    for (int64_t i = g->first; i < g->last; ++i) {
        struct call *c = &now->calls[i];
        const int was_read = together || c->stack;
        if (was_read ? c->stage == GET : timed_reading(c)) {
            failure[1] = i, failure[2] = GET;
            return c->status;
        }
        if (was_read) memcpy(c->outputs, c->fresh, (size_t)c->n_outputs * sizeof *c->outputs);
        if ((failure[2] = follow(c->tracks, c->outputs, c->n_outputs)) >= 0) {
            failure[1] = i;
            return NOT_FINITE;
        }
    }
    return 0;
}

/* Do `count` communication steps from `index`; after each, an observer's `rows` get one, unless there is none (NULL).
   Returns 0, or the status of the call that failed with failure = {steps completed, call, SET | STEP | GET} or
   {steps completed, reading, NOTE}; or NOT_FINITE with failure = {steps completed, call, output}.
   Where several are refused in one step, it is the first in the schedule's order, whoever did it. */
EXPORT int advance(struct call *calls, const struct group *groups, int64_t n_groups, struct team *team, const double *y,
                   struct rows *rows, int64_t index, int64_t count, double step_size, int64_t *failure) {
    struct now now = {calls, y, 0, step_size};
    if (team) team_agree(team, whole_call, &now);
    for (int64_t k = index; k < index + count; ++k) {
        now.time = (double)k * step_size;
        for (int64_t g = 0; g < n_groups; ++g) {
            const int status = step_group(&now, &groups[g], team, failure);
            if (status) {
                failure[0] = k;
                return status;
            }
        }
        const int refused = rows ? note(rows, k + 1, &failure[1]) : 0;
        if (refused) {
            failure[0] = k + 1, failure[2] = NOTE;
            return refused;
        }
    }
    return 0;
}

/* -- steps in which inputs follow straight lines: `MidpointLoop` in second_order.py, to the last bit ------------------ */

enum { UNSETTLED = -2, PASSES = 20 };

static int give(struct call *c) {
    if (!c->n_inputs) return 0;
    return c->set_real(c->component, c->input_references, (size_t)c->n_inputs, c->inputs);
}

/* One component's step in parts, with inputs on lines from `from` to `to`. Returns the failing call's kind, or 0. */
static int walk(struct call *c, const double *from, const double *to, int64_t k, int64_t parts, double step_size,
                int *status) {
    const double part = step_size / (double)parts;
    for (int64_t j = 0; j < parts; ++j) {
        const double along = ((double)j + 0.5) / (double)parts;
        for (int64_t i = 0; i < c->n_inputs; ++i) {
            const int64_t s = c->sources[i];
            const double slope = to[s] - from[s], rise = slope * along;
            c->inputs[i] = from[s] + rise;
        }
        if ((*status = give(c)) > 1) return SET;
        if ((*status = c->step(c->component, (double)(k * parts + j) * part, part, 1)) > 1) return STEP;
    }
    return 0;
}

/* Whether a component's inputs differ from the newest outputs; they are gathered. */
static int renewed(struct call *c, const double *y) {
    int changed = 0;
    for (int64_t i = 0; i < c->n_inputs; ++i) {
        if (c->inputs[i] != y[c->sources[i]]) changed = 1;
        c->inputs[i] = y[c->sources[i]];
    }
    return changed;
}

/* As `advance`. `direct` tells which components' outputs depend on inputs directly; `before` has the outputs one step
   earlier, `end` is room for as many. y is written through the calls' outputs. */
EXPORT int advance_lines(struct call *calls, const struct group *groups, int64_t n_groups, const double *y,
                         const int64_t *direct, double *before, double *end, int64_t outputs, int64_t parts, int64_t index,
                         int64_t count, double step_size, int64_t *failure) {
    const int64_t n = n_groups ? groups[n_groups - 1].last : 0;
    for (int64_t k = index; k < index + count; ++k) {
        int status;
        failure[0] = k;
        for (int64_t i = 0; i < outputs; ++i) {
            const double twice = 2 * y[i];
            end[i] = twice - before[i];
            before[i] = y[i];
        }
        for (int64_t g = 0; g < n_groups; ++g) {
            const int64_t first = groups[g].first, last = groups[g].last;
            for (int64_t m = first; m < last; ++m) {
                const double start = seconds();
                if ((failure[2] = walk(&calls[m], before, end, k, parts, step_size, &status))) {
                    failure[1] = m;
                    return status;
                }
                calls[m].spent += seconds() - start;
            }
            for (int64_t m = first; m < last; ++m) {
                struct call *c = &calls[m];
                const double start = seconds();
                failure[1] = m;
                if (direct[m]) {
                    for (int64_t i = 0; i < c->n_inputs; ++i) c->inputs[i] = end[c->sources[i]];
                    failure[2] = SET;
                    if ((status = give(c)) > 1) return status;
                }
                failure[2] = GET;
                if ((status = read_one(c, c->outputs)) > 1) return status;
                c->spent += seconds() - start;
            }
            for (int64_t m = first; m < last; ++m)
                for (int64_t i = 0; i < calls[m].n_outputs; ++i) end[calls[m].outputs - y + i] = calls[m].outputs[i];
        }
        int changed = 1;
        for (int pass = 0; changed && pass < PASSES; ++pass) {
            changed = 0;
            for (int64_t m = 0; m < n; ++m) {
                struct call *c = &calls[m];
                if (!renewed(c, y)) continue;
                const double start = seconds();
                failure[1] = m, failure[2] = SET;
                if ((status = give(c)) > 1) return status;
                if (direct[m]) {
                    failure[2] = GET;
                    if ((status = read_one(c, c->outputs)) > 1) return status;
                    changed = 1;
                }
                c->spent += seconds() - start;
            }
        }
        for (int64_t m = 0; m < n; ++m) {
            failure[1] = m;
            if ((failure[2] = follow(calls[m].tracks, calls[m].outputs, calls[m].n_outputs)) >= 0) return NOT_FINITE;
        }
        if (changed) return UNSETTLED;
    }
    return 0;
}
