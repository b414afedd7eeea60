/* One FMU behind an ideal voltage: for every communication step set the inputs, step, read the outputs.
   `bench.py` calls it. Returns 0, or the status of the first call that is neither OK nor Warning. */
#include "many_steps.h"
#include <math.h>

EXPORT int drive(void *component, get_set set_real, get_set get_real, do_step step, const struct steps *asked,
                 int64_t *failed) {
    const size_t n_in = (size_t)asked->n_in, n_out = (size_t)asked->n_out;
    const double *in = asked->inputs, *late = asked->late;
    for (int64_t k = 0; k < asked->count; ++k) {
        int status = set_real(component, asked->input_references, n_in, (double *)in + k * asked->n_in);
        failed[0] = k, failed[1] = CALLED_SET;
        if (status > 1) return status;
        status = step(component, (double)(asked->index + k) * asked->step_size, asked->step_size, 1);
        failed[1] = CALLED_STEP;
        if (status > 1) return status;
        if (late) {
            status = set_real(component, asked->input_references, n_in, (double *)late + k * asked->n_in);
            failed[1] = CALLED_SET;
            if (status > 1) return status;
        }
        status = get_real(component, asked->output_references, n_out, asked->outputs + k * asked->n_out);
        failed[1] = CALLED_GET;
        if (status > 1) return status;
    }
    return 0;
}

/* `gfor_step_stack` of an FMU's library. */
typedef int (*step_stack)(void **, size_t, double, double, int *);

enum { MOST_BESIDE = 8 };

/* Those of some components that go on side by side: what each is called with, and its place among all. */
struct beside {
    void *component[MOST_BESIDE];
    int64_t place[MOST_BESIDE], count;
    int status[MOST_BESIDE];
};

/* Leave out those that refused a call, and note it in their place. */
static void leave_out(struct beside *b, int *refused) {
    int64_t kept = 0;
    for (int64_t i = 0; i < b->count; ++i) {
        if (b->status[i] > 1) {
            refused[b->place[i]] = b->status[i];
            continue;
        }
        b->component[kept] = b->component[i], b->place[kept++] = b->place[i];
    }
    b->count = kept;
}

/* As `drive`, several components of one library that step side by side, with steps that differ in their rows alone.
   refused: 0 for each, or the status with which it refused a call and made no more steps; one that has it makes none. */
EXPORT void drive_beside(void **components, get_set set_real, get_set get_real, step_stack step,
                         const struct steps *asked, int64_t n, int *refused) {
    struct beside b = {.count = 0};
    for (int64_t i = 0; i < n && i < MOST_BESIDE; ++i)
        if (!refused[i]) b.component[b.count] = components[i], b.place[b.count++] = i;
    const size_t n_in = (size_t)asked->n_in, n_out = (size_t)asked->n_out;
    for (int64_t k = 0; k < asked->count && b.count; ++k) {
        for (int64_t i = 0; i < b.count; ++i) {
            const struct steps *own = asked + b.place[i];
            b.status[i] = set_real(b.component[i], own->input_references, n_in, (double *)own->inputs + k * own->n_in);
        }
        leave_out(&b, refused);
        step(b.component, (size_t)b.count, (double)(asked->index + k) * asked->step_size, asked->step_size, b.status);
        leave_out(&b, refused);
        for (int64_t i = 0; i < b.count; ++i) {
            const struct steps *own = asked + b.place[i];
            double *late = (double *)own->late;
            b.status[i] = late ? set_real(b.component[i], own->input_references, n_in, late + k * own->n_in) : 0;
            if (b.status[i] > 1) continue;
            b.status[i] = get_real(b.component[i], own->output_references, n_out, own->outputs + k * own->n_out);
        }
        leave_out(&b, refused);
    }
}

/* A run whose voltage turns with the component's current; `held_in_step.py` says why. Complex numbers are pairs. */
struct turning {
    const double *voltage, *late; /* for each step: that which is held, and that at which the outputs are read [pu] */
    const double *measured;       /* the conjugate of the measured current's mean in each stretch */
    const double *along;          /* times of a stretch's steps since its begin [s] */
    double *angle, *ahead;        /* room for a stretch: the turn [rad], and its phasor */
    double *current, *turns;      /* found for each step: the current, and by how much the turn counts */
    int64_t count, each;          /* steps, and those of a stretch */
    double gain, lasts, scale;    /* [1/s], [s], of the outputs */
    double turn, slow, rate;      /* where it stands [rad], [rad], [rad/s] */
};

enum { NOT_FINITE = -1 };

/* The product as NumPy rounds it: with one rounding less in each part. */
static void times(const double *a, const double *b, double *product) {
    const double re = a[0], im = a[1];
    product[0] = fma(re, b[0], -(im * b[1]));
    product[1] = fma(re, b[1], im * b[0]);
}

/* The sum in NumPy's order: in pairs. */
static void sum_in_pairs(const double *a, int64_t count, double *sum) {
    double eight[8] = {0};
    int64_t k = 0;
    if (count > 64) {
        const int64_t half = count / 2 - count / 2 % 4;
        double other[2];
        sum_in_pairs(a, half, sum);
        sum_in_pairs(a + 2 * half, count - half, other);
        sum[0] += other[0], sum[1] += other[1];
        return;
    }
    for (; count >= 4 && k < count - count % 4; k += 4)
        for (int j = 0; j < 8; ++j) eight[j] += a[2 * k + j];
    sum[0] = eight[0] + eight[2] + (eight[4] + eight[6]);
    sum[1] = eight[1] + eight[3] + (eight[5] + eight[7]);
    for (; k < count; ++k) sum[0] += a[2 * k], sum[1] += a[2 * k + 1];
}

/* As `drive`, whose rows are those of one stretch; NOT_FINITE where an output is no finite number. */
EXPORT int drive_turning(void *component, get_set set_real, get_set get_real, do_step step, struct steps *asked,
                         int64_t *failed, struct turning *run) {
    double *in = (double *)asked->inputs, *late = (double *)asked->late;
    for (int64_t first = 0; first < run->count; first += run->each) {
        const int64_t count = first + run->each < run->count ? run->each : run->count - first;
        for (int64_t k = 0; k < count; ++k) {
            run->angle[k] = run->turn + run->rate * run->along[k];
            run->ahead[2 * k] = cos(run->angle[k]), run->ahead[2 * k + 1] = sin(run->angle[k]);
            times(run->voltage + 2 * (first + k), run->ahead + 2 * k, in + 2 * k);
            times(run->late + 2 * (first + k), run->ahead + 2 * k, late + 2 * k);
        }
        asked->count = count;
        const int status = drive(component, set_real, get_real, step, asked, failed);
        if (status) return status;
        for (int64_t k = 0; k < count * asked->n_out; ++k)
            if (!isfinite(asked->outputs[k])) return NOT_FINITE;
        for (int64_t k = 0; k < count; ++k) {
            const double *out = asked->outputs + k * asked->n_out;
            const double own[2] = {out[0] * run->scale, out[1] * run->scale};
            const double back[2] = {run->ahead[2 * k], -run->ahead[2 * k + 1]};
            times(own, back, run->current + 2 * (first + k));
            run->turns[first + k] = run->angle[k] - run->slow;
        }
        double sum[2];
        sum_in_pairs(run->current + 2 * first, count, sum);
        const double part = 1.0 / (double)count, *measured = run->measured + first / run->each * 2;
        run->turn = run->angle[count - 1];
        run->slow += (run->turn - run->slow) * run->along[count - 1] / run->lasts;
        run->rate = run->gain * (sum[0] * part * measured[1] + sum[1] * part * measured[0]);
        asked->index += count;
    }
    return 0;
}
