/* An FMU of FMI 3.0 as the adapter sees it: its functions, what its description says of events and clocks, and what has
   to be remembered of each instance. `fmi3.py` fills the table; it compiles this file, fmi3_events.c and fmi3_as_fmi2.c as one. */
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi.h"

enum { OK, WARNING, DISCARD, ERROR };
enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN, KINDS };

typedef void (*fmi3_log)(void *, int, const char *, const char *);
typedef int (*values)(void *, const unsigned *, size_t, void *, size_t);

enum { PERIODIC, CHANGING, COUNTDOWN, OUTPUT };

/* A clock. Its times are declared, or asked of the FMU while it is initialised and, where they may change, after events. */
struct clock {
    double interval, shift;
    unsigned reference;
    int32_t kind, asked, tunable;
};

enum { DISCRETE_INPUT, CLOCKED_INPUT, CLOCKED };

/* A variable that may not be read or set at any time: an input whose change is an event, or one that belongs to clocks
   and is there only while one of them ticks. */
struct special {
    uint64_t clocks; /* bits: places of its clocks */
    double start;
    unsigned reference;
    int32_t kind, role;
};

struct table {
    void *(*instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned *, size_t, void *,
                         fmi3_log, void *);
    void (*free_instance)(void *);
    int (*set_debug_logging)(void *, bool, size_t, const char *const *);
    int (*enter_initialization)(void *, bool, double, double, bool, double);
    int (*exit_initialization)(void *);
    int (*terminate)(void *);
    int (*reset)(void *);
    int (*do_step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    int (*get_state)(void *, void **);
    int (*set_state)(void *, void *);
    int (*free_state)(void *, void **);
    int (*state_size)(void *, void *, size_t *);
    int (*serialize)(void *, void *, unsigned char *, size_t);
    int (*deserialize)(void *, const unsigned char *, size_t, void **);
    int (*derivative)(void *, const unsigned *, size_t, const unsigned *, size_t, const double *, size_t, double *, size_t);
    int (*enter_event_mode)(void *);
    int (*enter_step_mode)(void *);
    int (*update_discrete_states)(void *, bool *, bool *, bool *, bool *, bool *, double *);
    int (*get_interval)(void *, const unsigned *, size_t, double *, int *);
    int (*get_shift)(void *, const unsigned *, size_t, double *);
    int (*set_clock)(void *, const unsigned *, size_t, const bool *);
    int (*get_clock)(void *, const unsigned *, size_t, bool *);
    values get[KINDS], set[KINDS];
    const char *resources;
    const unsigned *references; /* of all variables, sorted */
    const unsigned char *kinds; /* of the same */
    size_t n;
    int64_t narrow; /* whether there is a Float32 */
    int64_t events, early; /* whether events are handled, whether it may return early from a step */
    const struct clock *clocks;
    size_t n_clocks;
    const struct special *specials; /* sorted by reference */
    size_t n_specials;
};

struct callbacks {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *free, *finished, *environment;
};

/* Ticks are counted from `base`, so that no sum of intervals drifts. */
struct pace {
    double base, interval, next;
    int64_t ticks;
};

struct cell {
    double value;
    int64_t known;
};

/* What changes while an instance runs: a saved state holds it. */
struct course {
    double now, reached, next_event;
    int64_t running, open, ended; /* after initialisation; in Event Mode; by itself */
};

struct instance {
    struct table fmu;
    const struct callbacks *callbacks;
    void *inner;
    char *name;
    double start, stop, tolerance;
    int stops, tolerates;
    struct course course;
    struct pace *paces; /* of each clock */
    struct cell *cells; /* of each special variable: what waits for its clock, or was read when it ticked, or was set */
};

static const struct table *next; /* for the next instance */

EXPORT void fmi3_prepare(const struct table *table) { next = table; }

/* The logger takes a printf format. That '#' has a meaning as well is left alone: the master's logger gives it none. */
static void receive(void *environment, int status, const char *category, const char *text) {
    struct instance *s = environment;
    char format[2048];
    size_t k = 0;
    if (!s || !s->callbacks->logger) return;
    for (text = text ? text : ""; *text && k < sizeof format - 2; ++text) {
        if (*text == '%') format[k++] = *text;
        format[k++] = *text;
    }
    format[k] = 0;
    s->callbacks->logger(s->callbacks->environment, s->name, status, category ? category : "", format);
}

static int say(struct instance *s, int status, const char *format, ...) {
    char text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    receive(s, status, "", text);
    return status;
}

static int kind_of(const struct instance *s, unsigned reference) {
    size_t low = 0, high = s->fmu.n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (s->fmu.references[middle] < reference)
            low = middle + 1;
        else
            high = middle;
    }
    return low < s->fmu.n && s->fmu.references[low] == reference ? s->fmu.kinds[low] : KINDS;
}

#define WORST(worst, call) \
    do { \
        const int status_ = (call); \
        if (status_ > worst) worst = status_; \
    } while (0)

/* Return what a call says unless it is OK or a warning. */
#define MUST(call) \
    do { \
        const int status_ = (call); \
        if (status_ > WARNING) return status_; \
    } while (0)

union any {
    double f64;
    float f32;
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int32_t i32;
    uint32_t u32;
    int64_t i64;
    uint64_t u64;
    bool truth;
};

static double number(int kind, const union any *v) {
    switch (kind) {
        case FLOAT64: return v->f64;
        case FLOAT32: return v->f32;
        case INT8: return v->i8;
        case UINT8: return v->u8;
        case INT16: return v->i16;
        case UINT16: return v->u16;
        case INT32: return v->i32;
        case UINT32: return v->u32;
        case INT64: return (double)v->i64;
        case UINT64: return (double)v->u64;
        default: return v->truth;
    }
}

static union any typed(int kind, double x) {
    union any v = {0};
    switch (kind) {
        case FLOAT64: v.f64 = x; break;
        case FLOAT32: v.f32 = (float)x; break;
        case INT8: v.i8 = (int8_t)x; break;
        case UINT8: v.u8 = (uint8_t)x; break;
        case INT16: v.i16 = (int16_t)x; break;
        case UINT16: v.u16 = (uint16_t)x; break;
        case INT32: v.i32 = (int32_t)x; break;
        case UINT32: v.u32 = (uint32_t)x; break;
        case INT64: v.i64 = (int64_t)x; break;
        case UINT64: v.u64 = (uint64_t)x; break;
        default: v.truth = x != 0;
    }
    return v;
}
