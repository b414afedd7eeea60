/* An FMU of FMI 3.0 with all that Event Mode is for, strict about what is allowed when. Nothing in it knows this project.
   A ball that bounces (early return, event), a clock that samples, one that counts down after a discrete input changed,
   one whose interval grows, an output clock, and an end of its own. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR };
enum { INSTANTIATED, INITIALISING, EVENT, STEP, TERMINATED };
enum { TIME, X, V, E, REST, SAMPLE = 10, COUNT, SAMPLED, U, LATE = 20, GATE, FIRED, DELAY, CHANGES, GROWING = 30, GROWN,
       END = 40, OUT = 50, HALF, PERIODS = 60, PERIOD, BEATS };
typedef void (*log_message)(void *, int, const char *, const char *);

struct state {
    double time, x, v, e, count, sampled, u, fired, delay, changes, grown, end, half, period, beats;
    int mode, gate, was, bounce, resting, counting, pulled, sample, late, growing, out, beat, new_growth, new_period;
};
struct fmu {
    struct state s;
    double hidden; /* what FAULT_HIDDEN does not save */
    log_message log;
    void *environment;
};

static int refuse(struct fmu *f, const char *format, ...) {
    char text[200];
    va_list a;
    va_start(a, format);
    vsnprintf(text, sizeof text, format, a);
    va_end(a);
    f->log(f->environment, ERROR, "logStatusError", text);
    return ERROR;
}
static void defaults(struct state *s) {
    *s = (struct state){.x = 1, .e = 0.7, .delay = 0.25, .fired = -1, .period = 0.2};
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool events, bool early, const unsigned *r, size_t n, void *environment, log_message log,
                                         void *intermediate) {
    struct fmu *f = calloc(1, sizeof *f);
    f->log = log, f->environment = environment;
    if (!events || !early) {
        refuse(f, "it has clocks, and needs eventModeUsed and earlyReturnAllowed");
        free(f);
        return NULL;
    }
    defaults(&f->s);
    return f;
}
EXPORT void fmi3FreeInstance(struct fmu *f) { free(f); }
EXPORT int fmi3SetDebugLogging(struct fmu *f, bool on, size_t n, const char *const *c) { return OK; }
EXPORT int fmi3EnterInitializationMode(struct fmu *f, bool tolerates, double tolerance, double start, bool stops, double stop) {
    f->s.time = start, f->s.mode = INITIALISING;
    return OK;
}
EXPORT int fmi3ExitInitializationMode(struct fmu *f) {
    f->s.mode = EVENT, f->s.was = f->s.gate;
    return OK;
}
EXPORT int fmi3EnterEventMode(struct fmu *f) {
    if (f->s.mode != STEP) return refuse(f, "Event Mode is entered from Step Mode");
    f->s.mode = EVENT;
    return OK;
}
EXPORT int fmi3EnterStepMode(struct fmu *f) {
    if (f->s.mode != EVENT) return refuse(f, "Step Mode is entered from Event Mode");
    f->s.mode = STEP;
    return OK;
}
EXPORT int fmi3Terminate(struct fmu *f) {
    f->s.mode = TERMINATED;
    return OK;
}
EXPORT int fmi3Reset(struct fmu *f) {
    defaults(&f->s);
    f->hidden = 0;
    return OK;
}

EXPORT int fmi3DoStep(struct fmu *f, double time, double step, bool fixed, bool *event, bool *stop, bool *early, double *reached) {
    struct state *s = &f->s;
    *event = *stop = *early = false, *reached = time + step;
    if (s->mode != STEP) return refuse(f, "a step needs Step Mode");
    if (fabs(time - s->time) > 1e-9 || !(step > 0)) return refuse(f, "a step of %g s from t = %.12g s, not from %.12g s", step, s->time, time);
#ifdef FAULT_STANDS_STILL
    if (time > 0.2) {
        *early = true, *reached = time;
        return OK;
    }
#endif
    const double g = 9.81, t = (s->v + sqrt(s->v * s->v + 2 * g * s->x)) / g; /* until it touches the ground */
    if (!s->resting && t <= step) {
        s->x = 0, s->v -= g * t, s->time = time + t, s->bounce = 1;
        *event = true, *early = t < step, *reached = s->time;
        return OK;
    }
    if (!s->resting) s->x += s->v * step - g * step * step / 2, s->v -= g * step;
    s->time = time + step;
    return OK;
}

EXPORT int fmi3UpdateDiscreteStates(struct fmu *f, bool *again, bool *stop, bool *nominals, bool *states, bool *timed, double *when) {
    struct state *s = &f->s;
    if (s->mode != EVENT) return refuse(f, "discrete states are updated in Event Mode");
    *again = *stop = *nominals = *states = *timed = false;
    if (s->bounce) {
        s->v *= -s->e, s->bounce = 0;
        if (s->v < 0.1) s->resting = 1, s->v = 0;
    }
    if (s->gate != s->was) ++s->changes, s->was = s->gate, s->counting = s->gate, *again = true;
    if (s->late) s->fired = s->time, s->counting = 0, s->late = 0;
    if (s->growing) ++s->grown, s->growing = 0, s->new_growth = 1;
    if (s->beat) ++s->beats, s->beat = 0;
    s->sample = s->out = 0;
    if (s->end > 0) {
        *timed = true, *when = s->end;
        *stop = s->time > s->end - 1e-9;
    }
#ifdef FAULT_ENDLESS
    if (s->time > 0.2) *again = true;
#endif
    return OK;
}

/* -- clocks ------------------------------------------------------------------------------------- */

EXPORT int fmi3SetClock(struct fmu *f, const unsigned *r, size_t n, const bool *x) {
    if (f->s.mode != EVENT) return refuse(f, "a clock ticks in Event Mode");
    for (size_t k = 0; k < n; ++k) switch (r[k]) {
            case SAMPLE:
                f->s.sample = 1, ++f->s.count, ++f->hidden;
                if (fmod(f->s.count, 2) == 0) f->s.out = 1, ++f->s.half;
#ifdef FAULT_HIDDEN
                f->s.count = f->hidden;
#endif
                break;
            case LATE: f->s.late = 1; break;
            case GROWING: f->s.growing = 1; break;
            case PERIODS: f->s.beat = 1; break;
            default: return refuse(f, "there is no input clock %u", r[k]);
        }
    return OK;
}
EXPORT int fmi3GetClock(struct fmu *f, const unsigned *r, size_t n, bool *x) {
    for (size_t k = 0; k < n; ++k) x[k] = r[k] == OUT && f->s.out;
    return OK;
}
EXPORT int fmi3GetIntervalDecimal(struct fmu *f, const unsigned *r, size_t n, double *x, int *qualifier) {
    struct state *s = &f->s;
    if (s->mode != EVENT && s->mode != INITIALISING) return refuse(f, "intervals are asked for in Event Mode");
    for (size_t k = 0; k < n; ++k) {
        x[k] = 0, qualifier[k] = 0;
        if (r[k] == LATE && s->counting) x[k] = s->delay, qualifier[k] = s->counting == 1 ? 2 : 1, s->counting = 2;
        if (r[k] == GROWING) x[k] = 0.1 * (s->grown + 1), qualifier[k] = s->mode == INITIALISING || s->new_growth ? 2 : 1, s->new_growth = 0;
        if (r[k] == PERIODS) x[k] = s->period, qualifier[k] = s->mode == INITIALISING || s->new_period ? 2 : 1, s->new_period = 0;
    }
    return OK;
}
EXPORT int fmi3GetShiftDecimal(struct fmu *f, const unsigned *r, size_t n, double *x) {
    for (size_t k = 0; k < n; ++k) {
        if (r[k] != PERIODS) return refuse(f, "clock %u has no shift", r[k]);
        x[k] = 0.05;
    }
    return OK;
}

/* -- values ------------------------------------------------------------------------------------- */

static double *real(struct state *s, unsigned r) {
    switch (r) {
        case TIME: return &s->time;
        case X: return &s->x;
        case V: return &s->v;
        case E: return &s->e;
        case COUNT: return &s->count;
        case SAMPLED: return &s->sampled;
        case U: return &s->u;
        case FIRED: return &s->fired;
        case DELAY: return &s->delay;
        case CHANGES: return &s->changes;
        case GROWN: return &s->grown;
        case END: return &s->end;
        case HALF: return &s->half;
        case PERIOD: return &s->period;
        case BEATS: return &s->beats;
    }
    return NULL;
}
static bool there(struct fmu *f, unsigned r) {
    if (r == COUNT || r == SAMPLED || r == U) return f->s.sample;
    return r != HALF || f->s.out;
}
EXPORT int fmi3GetFloat64(struct fmu *f, const unsigned *r, size_t n, double *x, size_t m) {
    for (size_t k = 0; k < n; ++k) {
        if (!real(&f->s, r[k])) return refuse(f, "there is no variable %u", r[k]);
        if (!there(f, r[k])) return refuse(f, "variable %u is read while its clock does not tick", r[k]);
        if (r[k] == SAMPLED) f->s.sampled = f->s.u;
        x[k] = *real(&f->s, r[k]);
    }
    return OK;
}
EXPORT int fmi3SetFloat64(struct fmu *f, const unsigned *r, size_t n, const double *x, size_t m) {
    for (size_t k = 0; k < n; ++k) {
        if (!real(&f->s, r[k])) return refuse(f, "there is no variable %u", r[k]);
        if (!there(f, r[k])) return refuse(f, "variable %u is set while its clock does not tick", r[k]);
        if (r[k] == PERIOD && f->s.mode == STEP) return refuse(f, "the period changes in Event Mode");
        if (r[k] == PERIOD && f->s.mode == EVENT) f->s.new_period = 1;
        *real(&f->s, r[k]) = x[k];
    }
    return OK;
}
EXPORT int fmi3GetBoolean(struct fmu *f, const unsigned *r, size_t n, bool *x, size_t m) {
    for (size_t k = 0; k < n; ++k) x[k] = r[k] == REST ? f->s.resting : f->s.gate;
    return OK;
}
EXPORT int fmi3SetBoolean(struct fmu *f, const unsigned *r, size_t n, const bool *x, size_t m) {
    if (f->s.mode == STEP) return refuse(f, "a discrete input changes in Event Mode");
    for (size_t k = 0; k < n; ++k) f->s.gate = x[k];
    return OK;
}

/* -- state -------------------------------------------------------------------------------------- */

EXPORT int fmi3GetFMUState(struct fmu *f, void **copy) {
    if (!*copy) *copy = malloc(sizeof *f);
    memcpy(*copy, f, sizeof *f);
    return OK;
}
EXPORT int fmi3SetFMUState(struct fmu *f, void *copy) {
    f->s = ((struct fmu *)copy)->s;
#ifndef FAULT_HIDDEN
    f->hidden = ((struct fmu *)copy)->hidden;
#endif
    return OK;
}
EXPORT int fmi3FreeFMUState(struct fmu *f, void **copy) {
    free(*copy);
    *copy = NULL;
    return OK;
}
EXPORT int fmi3SerializedFMUStateSize(struct fmu *f, void *copy, size_t *size) {
    *size = sizeof *f;
    return OK;
}
EXPORT int fmi3SerializeFMUState(struct fmu *f, void *copy, uint8_t *bytes, size_t size) {
    if (size != sizeof *f) return refuse(f, "a state has %zu bytes", sizeof *f);
    memcpy(bytes, copy, size);
    return OK;
}
EXPORT int fmi3DeserializeFMUState(struct fmu *f, const uint8_t *bytes, size_t size, void **copy) {
    if (size != sizeof *f) return refuse(f, "a state has %zu bytes", sizeof *f);
    *copy = malloc(size);
    memcpy(*copy, bytes, size);
    return OK;
}
